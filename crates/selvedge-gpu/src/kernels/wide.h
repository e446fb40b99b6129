// Vectors and bending angles in f64, for losses and gradients.

#define HALF_TURN 3.14159265358979323846
#define LEAST_NORMAL 2.2250738585072014e-308
#define LARGEST_DOUBLE 1.7976931348623157e308

INNER Wide wide(const double *at) {
    const Wide w = {at[0], at[1], at[2]};
    return w;
}
INNER Wide wide_minus(Wide a, Wide b) {
    const Wide w = {a.x - b.x, a.y - b.y, a.z - b.z};
    return w;
}
INNER Wide wide_times(double s, Wide a) {
    const Wide w = {s * a.x, s * a.y, s * a.z};
    return w;
}
INNER double wide_dot(Wide a, Wide b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INNER Wide wide_cross(Wide a, Wide b) {
    const Wide w = {a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y};
    return w;
}
INNER void leave(double *to, Wide w) { to[0] = w.x, to[1] = w.y, to[2] = w.z; }
INNER int is_normal(double x) { return x >= LEAST_NORMAL && x <= LARGEST_DOUBLE; }

// The corners of a hinge.
typedef struct { Wide from, to, left, right; } Corners;

INNER Corners corners_at(const double *positions, const unsigned *hinge) {
    const Corners c = {wide(positions + 3 * (size_t)hinge[0]), wide(positions + 3 * (size_t)hinge[1]),
                       wide(positions + 3 * (size_t)hinge[2]), wide(positions + 3 * (size_t)hinge[3])};
    return c;
}

// The bending angle over a hinge [rad].
INNER double wide_angle(Corners at) {
    const Wide along = wide_minus(at.to, at.from), right = wide_minus(at.right, at.from);
    const Wide normal = wide_cross(along, wide_minus(at.left, at.from));
    const double sine = 0.0 - sqrt(wide_dot(along, along)) * wide_dot(normal, right);
    return atan2(sine, wide_dot(normal, wide_cross(right, along)));
}

// Gradient of the bending angle with respect to from, to, left and right [4, 3], times `factor`;
// zero where the angle has none.
INNER void angle_slopes(Corners at, double factor, double *slopes) {
    const Wide along = wide_minus(at.to, at.from);
    const Wide left = wide_minus(at.left, at.from), right = wide_minus(at.right, at.from);
    const Wide normal_left = wide_cross(along, left), normal_right = wide_cross(right, along);
    const double square_left = wide_dot(normal_left, normal_left);
    const double square_right = wide_dot(normal_right, normal_right);
    if (!is_normal(square_left) || !is_normal(square_right)) {
        for (int i = 0; i < 12; ++i) slopes[i] = 0.0;
        return;
    }
    const double square = wide_dot(along, along), size = sqrt(square) * factor;
    const Wide by_left = wide_times(-size / square_left, normal_left);
    const Wide by_right = wide_times(-size / square_right, normal_right);
    const double foot_left = wide_dot(left, along) / square, foot_right = wide_dot(right, along) / square;
    const Wide by_to = wide_minus(wide_times(-foot_left, by_left), wide_times(foot_right, by_right));
    const Wide none = {0.0, 0.0, 0.0};
    leave(slopes, wide_minus(wide_minus(wide_minus(none, by_left), by_right), by_to));
    leave(slopes + 3, by_to);
    leave(slopes + 6, by_left);
    leave(slopes + 9, by_right);
}

