// Motions that were computed before: what a split Gaussian has, or another skinning.

in vec3 shift_at;  // from the rest, object frame
in vec3 grown0;    // columns of the Jacobian minus the identity
in vec3 grown1;
in vec3 grown2;

void move(vec3 x, out vec3 shift, out mat3 grown) {
    shift = shift_at;
    grown = mat3(grown0, grown1, grown2);
}
