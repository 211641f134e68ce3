// Gaussians where they were lifted.

void move(vec3 x, out vec3 shift, out mat3 grown) {
    shift = vec3(0.0);
    grown = mat3(0.0);
}
