// What a prediction is judged by, in f64 as on the CPU: sums over vertices, edges and hinges of every
// lane, and the gradient of their weighted sum with respect to the normalised acceleration.
//
// A lane is a cloth in a place of its own; all places have the same numbers of vertices and edges.

// Where in `numbers` the statistics and the weights of the terms stand.
#define MEAN 0
#define DEVIATION 3
#define INVERSE 6
#define ENERGY_SCALE 9
#define VECTOR_SCALE 10
#define LENGTH_SCALE 13
#define ANGLE_SCALE 14
#define ENERGY_WEIGHT 15
#define VECTOR_WEIGHT 16
#define LENGTH_WEIGHT 17
#define ANGLE_WEIGHT 18

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

// from, to, left and right of a hinge.
typedef struct { Wide from, to, left, right; } Corners;

INNER Corners corners_at(const double *positions, const unsigned *hinge) {
    const Corners c = {wide(positions + 3 * (size_t)hinge[0]), wide(positions + 3 * (size_t)hinge[1]),
                       wide(positions + 3 * (size_t)hinge[2]), wide(positions + 3 * (size_t)hinge[3])};
    return c;
}

INNER double wide_angle(Corners at) {
    const Wide along = wide_minus(at.to, at.from), right = wide_minus(at.right, at.from);
    const Wide normal = wide_cross(along, wide_minus(at.left, at.from));
    const double sine = 0.0 - sqrt(wide_dot(along, along)) * wide_dot(normal, right);
    return atan2(sine, wide_dot(normal, wide_cross(right, along)));
}

// The gradient of the angle with respect to from, to, left and right, times a number; 0 where it has none.
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

// The shorter way round.
INNER double wrapped(double difference) {
    if (difference > HALF_TURN) return difference - 2.0 * HALF_TURN;
    if (difference <= -HALF_TURN) return difference + 2.0 * HALF_TURN;
    return difference;
}

// Where an acceleration leads: a + 2 p - p_previous; handles go to their target.
KERNEL(predict_positions) {
    for (unsigned k = 0; k < 3; ++k) {
        const size_t at = 3 * (size_t)ELEMENT + k;
        const double acceleration = predicted[at] * numbers[DEVIATION + k] + numbers[MEAN + k];
        const double moved = current[at] - previous[at];
        const int handle = handle_of[ELEMENT] != NO_HANDLE;
        positions[at] = handle ? target[at] : current[at] + (moved + acceleration);
    }
}

// What an edge and its hinge add to the terms, and the gradients with respect to the vector of the edge and
// to the corners of the hinge.
KERNEL(edge_losses) {
    const double share = shares[2 * (ELEMENT / per_lane) + 1];
    const unsigned *end = ends + 2 * (size_t)ELEMENT, *hinge = hinges + 4 * (size_t)ELEMENT;
    const size_t a = 3 * (size_t)end[0], b = 3 * (size_t)end[1];
    const Wide found = wide_minus(wide(positions + a), wide(positions + b));
    const Wide wanted = wide_minus(wide(target + a), wide(target + b));
    const double *scale = numbers + VECTOR_SCALE;
    const Wide off = wide_minus(found, wanted);
    const Wide apart = {scale[0] * off.x, scale[1] * off.y, scale[2] * off.z};
    const double length = sqrt(wide_dot(found, found));
    const double longer = numbers[LENGTH_SCALE] * (length - sqrt(wide_dot(wanted, wanted)));
    const double by_vector = 2.0 * numbers[VECTOR_WEIGHT] * share;
    const double by_length = length > 0.0
        ? 2.0 * numbers[LENGTH_WEIGHT] * share * longer * numbers[LENGTH_SCALE] / length : 0.0;
    by_edge[3 * (size_t)ELEMENT] = by_vector * apart.x * scale[0] + by_length * found.x;
    by_edge[3 * (size_t)ELEMENT + 1] = by_vector * apart.y * scale[1] + by_length * found.y;
    by_edge[3 * (size_t)ELEMENT + 2] = by_vector * apart.z * scale[2] + by_length * found.z;
    double bent = 0.0;
    if (hinge[0] != hinge[1]) {
        const Corners at = corners_at(positions, hinge);
        bent = numbers[ANGLE_SCALE] * wrapped(wide_angle(at) - wide_angle(corners_at(target, hinge)));
        const double by_angle = 2.0 * numbers[ANGLE_WEIGHT] * share * bent * numbers[ANGLE_SCALE];
        angle_slopes(at, by_angle, by_hinge + 12 * (size_t)ELEMENT);
    } else {
        for (unsigned i = 0; i < 12; ++i) by_hinge[12 * (size_t)ELEMENT + i] = 0.0;
    }
    terms[3 * (size_t)ELEMENT] = wide_dot(apart, apart);
    terms[3 * (size_t)ELEMENT + 1] = longer * longer;
    terms[3 * (size_t)ELEMENT + 2] = bent * bent;
}

// What a vertex adds to the terms, and the gradient of the whole with respect to its acceleration.
KERNEL(vertex_losses) {
    double *term = terms + 2 * (size_t)ELEMENT;
    float *out = gradient + 3 * (size_t)ELEMENT;
    term[0] = term[1] = 0.0;
    out[0] = out[1] = out[2] = 0.0f;
    if (handle_of[ELEMENT] != NO_HANDLE) return;
    double by_position[3] = {0.0, 0.0, 0.0};
    for (size_t arc = first_arc[ELEMENT]; arc < first_arc[ELEMENT + 1]; ++arc) {
        const size_t edge = arc_edges[arc];
        const double sign = ends[2 * edge] == ELEMENT ? 1.0 : -1.0;
        for (unsigned k = 0; k < 3; ++k) by_position[k] += sign * by_edge[3 * edge + k];
    }
    // Corner c of the hinge over edge e has number 4 e + c.
    for (size_t i = corner_ends[2 * (size_t)ELEMENT]; i < corner_ends[2 * (size_t)ELEMENT + 1]; ++i) {
        const double *slope = by_hinge + 3 * (size_t)corners[i];
        for (unsigned k = 0; k < 3; ++k) by_position[k] += slope[k];
    }
    const double share = shares[2 * (ELEMENT / per_lane)];
    const size_t at = 3 * (size_t)ELEMENT;
    double found = 0.0, wanted = 0.0, moved[3];
    for (unsigned k = 0; k < 3; ++k) {
        moved[k] = positions[at + k] - current[at + k];
        const double goal = target[at + k] - current[at + k];
        found += moved[k] * moved[k];
        wanted += goal * goal;
    }
    const double half_mass = 0.5 * mass[ELEMENT], scale = numbers[ENERGY_SCALE];
    const double energy = scale * (half_mass * found - half_mass * wanted);
    const double by_energy = 2.0 * numbers[ENERGY_WEIGHT] * share * energy * scale * mass[ELEMENT];
    term[1] = energy * energy;
    for (unsigned k = 0; k < 3; ++k) {
        const double before = current[at + k] - previous[at + k];
        const double acceleration = (target[at + k] - current[at + k]) - before;
        const double goal = (acceleration - numbers[MEAN + k]) * numbers[INVERSE + k];
        const double off = predicted[at + k] - goal;
        term[0] += off * off;
        const double by = by_position[k] + by_energy * moved[k];
        out[k] = (float)(2.0 * share * off + by * numbers[DEVIATION + k]);
    }
}

// Sums over a part of a lane, of so many vertices and edges: acceleration, kinetic energy, edge vector, edge
// length, bending angle.
KERNEL(loss_parts) {
    const size_t lane = ROW / parts, first = (size_t)(ROW % parts) * per_part;
    double sum[5] = {0.0, 0.0, 0.0, 0.0, 0.0};
    for (unsigned i = LANE; i < per_part; i += LANES) {
        const size_t at = first + i;
        if (at < vertices) {
            const double *term = of_vertices + 2 * (lane * vertices + at);
            for (unsigned k = 0; k < 2; ++k) sum[k] += term[k];
        }
        if (at < edges) {
            const double *term = of_edges + 3 * (lane * edges + at);
            for (unsigned k = 0; k < 3; ++k) sum[2 + k] += term[k];
        }
    }
    for (unsigned k = 0; k < 5; ++k) {
        const double whole = SUM_DOUBLES_OVER_LANES(sum[k]);
        if (LANE == 0) sums[5 * (size_t)ROW + k] = whole;
    }
}

// The terms of a lane: the sums of its parts, by what a vertex and an edge count.
KERNEL(loss_terms) {
    const double *of_parts = sums + 5 * (size_t)ROW * parts;
    for (unsigned k = 0; k < 5; ++k) {
        double sum = 0.0;
        for (unsigned part = LANE; part < parts; part += LANES) sum += of_parts[5 * (size_t)part + k];
        sum = SUM_DOUBLES_OVER_LANES(sum);
        if (LANE == 0) terms[5 * (size_t)ROW + k] = sum * shares[2 * ROW + (k < 2 ? 0 : 1)];
    }
}

// What the gradients of a lane count.
KERNEL(weigh) {
    const float weight = weights[ELEMENT / per_lane];
    for (unsigned k = 0; k < 3; ++k) gradient[3 * (size_t)ELEMENT + k] *= weight;
}

// The gradient of the mean square error.
KERNEL(square_error) {
    gradient[ELEMENT] = 2.0f * share * (found[ELEMENT] - target[ELEMENT]);
}
