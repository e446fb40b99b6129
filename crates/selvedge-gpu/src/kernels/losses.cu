// Losses of a prediction, in f64 as on the processor: sums over vertices, edges and hinges of every
// rollout slot, and the gradient of their weighted sum with respect to the normalised acceleration.
//
// A rollout slot is a section of the union with one cloth; all sections have the same numbers of
// vertices and edges.

// Offsets of the statistics and the weights of the terms in `numbers`.
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

// A difference of angles, the shorter way round.
INNER double wrapped(double difference) {
    if (difference > HALF_TURN) return difference - 2.0 * HALF_TURN;
    if (difference <= -HALF_TURN) return difference + 2.0 * HALF_TURN;
    return difference;
}

// Predicted positions a + 2 p - p_previous; handles go to their target.
KERNEL(predict_positions, ELEMENT, JUDGED, OUT double *positions EACH(3)) {
    for (unsigned k = 0; k < 3; ++k) {
        const size_t at = 3 * (size_t)ELEMENT + k;
        const double acceleration = predicted[at] * numbers[DEVIATION + k] + numbers[MEAN + k];
        const double moved = current[at] - previous[at];
        const int handle = handle_of[ELEMENT] != NO_HANDLE;
        positions[at] = handle ? target[at] : current[at] + (moved + acceleration);
    }
}

// Terms of one edge and its hinge, and their gradients with respect to the vector of the edge and
// to the corners of the hinge.
KERNEL(edge_losses, ELEMENT,
       const double *positions, const double *target, const unsigned *ends EACH(2), const unsigned *hinges EACH(4),
       const double *shares, unsigned per_slot, const double *numbers ALL(19),
       OUT double *by_edge EACH(3), OUT double *by_hinge EACH(12), OUT double *terms EACH(3)) {
    const double share = shares[2 * (ELEMENT / per_slot) + 1];
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

// Terms of one vertex, and the gradient of the loss with respect to its acceleration.
KERNEL(vertex_losses, ELEMENT,
       JUDGED, const double *positions EACH(3), const float *mass EACH(1), const unsigned *first_arc,
       const unsigned *arc_edges, const unsigned *ends, const double *by_edge, const unsigned *corner_ends EACH(2),
       const unsigned *corners, const double *by_hinge, const double *shares, unsigned per_slot,
       OUT float *gradient EACH(3), OUT double *terms EACH(2)) {
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
    const double share = shares[2 * (ELEMENT / per_slot)];
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

// Sums of the terms over one part of a rollout slot, of `per_part` vertices and edges:
// acceleration, kinetic energy, edge vector, edge length, bending angle.
KERNEL(loss_parts, ROW,
       const double *of_vertices, const double *of_edges, unsigned vertices, unsigned edges, unsigned per_part,
       unsigned parts, OUT double *sums EACH(5)) {
    const size_t slot = ROW / parts, first = (size_t)(ROW % parts) * per_part;
    double sum[5] = {0.0, 0.0, 0.0, 0.0, 0.0};
    for (unsigned i = LANE; i < per_part; i += LANES) {
        const size_t at = first + i;
        if (at < vertices) {
            const double *term = of_vertices + 2 * (slot * vertices + at);
            for (unsigned k = 0; k < 2; ++k) sum[k] += term[k];
        }
        if (at < edges) {
            const double *term = of_edges + 3 * (slot * edges + at);
            for (unsigned k = 0; k < 3; ++k) sum[2 + k] += term[k];
        }
    }
    for (unsigned k = 0; k < 5; ++k) {
        const double whole = SUM_DOUBLES_OVER_LANES(sum[k]);
        if (LANE == 0) sums[5 * (size_t)ROW + k] = whole;
    }
}

// Terms of one rollout slot: the sums of its parts, times the shares of one vertex and of one edge
// in the means.
KERNEL(loss_terms, ROW,
       const double *sums, const double *shares EACH(2), unsigned parts, OUT double *terms EACH(5)) {
    const double *of_parts = sums + 5 * (size_t)ROW * parts;
    for (unsigned k = 0; k < 5; ++k) {
        double sum = 0.0;
        for (unsigned part = LANE; part < parts; part += LANES) sum += of_parts[5 * (size_t)part + k];
        sum = SUM_DOUBLES_OVER_LANES(sum);
        if (LANE == 0) terms[5 * (size_t)ROW + k] = sum * shares[2 * ROW + (k < 2 ? 0 : 1)];
    }
}

// Multiplies the gradient of one vertex by the weight of its rollout slot.
KERNEL(weigh, ELEMENT, float *gradient EACH(3), const float *weights, unsigned per_slot) {
    const float weight = weights[ELEMENT / per_slot];
    for (unsigned k = 0; k < 3; ++k) gradient[3 * (size_t)ELEMENT + k] *= weight;
}

// Gradient of the mean square error.
KERNEL(square_error, ELEMENT,
       const float *found EACH(1), const float *target EACH(1), float share, OUT float *gradient EACH(1)) {
    gradient[ELEMENT] = 2.0f * share * (found[ELEMENT] - target[ELEMENT]);
}
