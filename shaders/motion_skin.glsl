// How a Gaussian's surroundings move: blended dual quaternions (deform/skinning.py, whose formulas
// and names these are). Everything is a difference from the rest, so that at rest it is 0.

in ivec4 control_points;
in vec4 share0;  // of each control point: its weight, and the weight's gradient
in vec4 share1;
in vec4 share2;
in vec4 share3;

uniform sampler2D nodes;    // a row a control point: q, m
uniform vec3 centre;        // of the control points, object frame
uniform vec3 drift;         // mean displacement
uniform vec2 stretches;     // least and most

// As in jacobians.py, for numbers of 32 bits.
const float ORTHOGONAL = 1e-7;  // cosine of two columns that need no further turn
const float VANISHED = 1e-6;    // x largest stretch: a direction so much shorter has no axis
const int SWEEPS = 6;

struct Sums {
    vec4 b, p;      // sum w q, sum w m
    mat3x4 db, dp;  // sum q (grad w)^T, sum m (grad w)^T
};

void accumulate(inout Sums sums, vec4 nearest, int node, vec4 share) {
    vec4 q = texelFetch(nodes, ivec2(0, node), 0), m = texelFetch(nodes, ivec2(1, node), 0);
    vec4 signed_share = dot(q, nearest) >= 0.0 ? share : -share;  // q and -q are the same turn
    sums.b += signed_share.x * q;
    sums.p += signed_share.x * m;
    sums.db += outerProduct(q, signed_share.yzw);
    sums.dp += outerProduct(m, signed_share.yzw);
}

// p + (0, vec(b) x y): the sums of u q from those of m; y is twice the place.
vec4 placed(vec4 p, vec4 b, vec3 y) {
    return p + vec4(0.0, cross(b.yzw, y));
}

// Vector part of the quaternion product a b*.
vec3 vector(vec4 a, vec4 b) {
    return b.x * a.yzw - a.x * b.yzw - cross(a.yzw, b.yzw);
}

// A column of sum_j g_j (grad w_j)^T.
vec3 column(vec4 b, vec4 p, vec3 d, vec4 turns, vec4 shifts, float scale) {
    return (vector(shifts, b) + vector(p, turns) - 2.0 * dot(b, turns) * d) * scale;
}

// The rotation of q, minus the identity; `scale` is 1 / |q|^2.
mat3 turned(vec4 q, float scale) {
    float w = q.x, x = q.y, y = q.z, z = q.w;
    return 2.0 * scale * mat3(
        -(y * y + z * z), x * y + w * z, x * z - w * y,
        x * y - w * z, -(x * x + z * z), y * z + w * x,
        x * z + w * y, y * z - w * x, -(x * x + y * y)
    );
}

// Turns columns j and k of both until those of `columns` are orthogonal (jacobians.py).
void turn_pair(inout mat3 columns, inout mat3 turns, int j, int k) {
    vec3 cj = columns[j], ck = columns[k], tj = turns[j], tk = turns[k];
    float alpha = dot(cj, cj), beta = dot(ck, ck), gamma = dot(cj, ck);
    float zeta = (beta - alpha) / (2.0 * gamma);
    float t = (zeta < 0.0 ? -1.0 : 1.0) / (abs(zeta) + sqrt(1.0 + zeta * zeta));
    t = abs(gamma) <= ORTHOGONAL * sqrt(alpha * beta) ? 0.0 : t;
    float c = inversesqrt(1.0 + t * t), s = c * t;
    columns[j] = c * cj - s * ck;
    columns[k] = s * cj + c * ck;
    turns[j] = c * tj - s * tk;
    turns[k] = s * tj + c * tk;
}

// One of the two changes its sign: the turns stay rotations.
void order_pair(inout mat3 columns, inout mat3 turns, int j, int k) {
    if (dot(columns[j], columns[j]) >= dot(columns[k], columns[k])) return;
    vec3 c = columns[j], t = turns[j];
    columns[j] = columns[k];
    columns[k] = -c;
    turns[j] = turns[k];
    turns[k] = -t;
}

// `f` with its stretches (singular values) in the range `stretches` (jacobians.py: limit_row).
mat3 limited(mat3 f) {
    mat3 left = f, right = mat3(1.0);
    for (int sweep = 0; sweep < SWEEPS; ++sweep) {
        turn_pair(left, right, 0, 1);
        turn_pair(left, right, 0, 2);
        turn_pair(left, right, 1, 2);
    }
    order_pair(left, right, 0, 1);
    order_pair(left, right, 1, 2);
    order_pair(left, right, 0, 1);
    float s0 = length(left[0]), s1 = length(left[1]);
    vec3 u0 = s0 > 0.0 ? left[0] / s0 : vec3(1.0, 0.0, 0.0);
    vec3 away = abs(u0);  // the axis from which u0 is farthest
    vec3 axis = away.x <= away.y && away.x <= away.z ? vec3(1, 0, 0)
        : away.y <= away.z ? vec3(0, 1, 0) : vec3(0, 0, 1);
    vec3 u1 = normalize(s1 > VANISHED * s0 ? left[1] : axis - dot(axis, u0) * u0);
    vec3 u2 = cross(u0, u1);
    float s2 = dot(u2, f * right[2]);
    if (stretches.x <= s2 && s0 <= stretches.y) return f;
    vec3 s = clamp(vec3(s0, s1, s2), stretches.x, stretches.y);
    return mat3(s.x * u0, s.y * u1, s.z * u2) * transpose(right);
}

// > 0 if the stretches of `f` are within the range for certain (jacobians.py).
float margin(mat3 f) {
    float square = dot(f[0], f[0]) + dot(f[1], f[1]) + dot(f[2], f[2]);
    float det = dot(f[0], cross(f[1], f[2]));
    return min(stretches.y * stretches.y - square, 2.0 * det - stretches.x * square);
}

// The way of the point x from its rest, and its motion's Jacobian minus the identity.
void move(vec3 x, out vec3 shift, out mat3 grown) {
    vec4 nearest = texelFetch(nodes, ivec2(0, control_points.x), 0);
    Sums sums = Sums(vec4(0.0), vec4(0.0), mat3x4(0.0), mat3x4(0.0));
    accumulate(sums, nearest, control_points.x, share0);
    accumulate(sums, nearest, control_points.y, share1);
    accumulate(sums, nearest, control_points.z, share2);
    accumulate(sums, nearest, control_points.w, share3);
    vec3 y = 2.0 * (x - centre);
    vec4 p = placed(sums.p, sums.b, y);
    float scale = 1.0 / dot(sums.b, sums.b);
    vec3 d = vector(p, sums.b) * scale;
    grown = turned(sums.b, scale);
    for (int k = 0; k < 3; ++k) {
        vec4 shifts = placed(sums.dp[k], sums.db[k], y);
        grown[k] += column(sums.b, p, d, sums.db[k], shifts, scale);
    }
    mat3 f = mat3(1.0) + grown;
    // A loop that most often has no turn: emulated GPUs jump over loops, but not over ifs.
    for (bool is_beyond = margin(f) <= 0.0; is_beyond; is_beyond = false)
        grown = limited(f) - mat3(1.0);
    shift = drift + d;
}
