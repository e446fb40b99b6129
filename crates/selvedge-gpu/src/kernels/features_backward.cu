// Gradients of positions, from the gradient of normalised features, for one frame of a window at a
// time, and through the integration. Handles are treated like other vertices here; join_prediction
// drops their gradient.

INNER Vector row_vector(const float *row, const float *scale, unsigned column) {
    const Vector v = {row[column] * scale[column], row[column + 1] * scale[column + 1],
                      row[column + 2] * scale[column + 2]};
    return v;
}
INNER void add_to(float *row, Vector v) { row[0] += v.x, row[1] += v.y, row[2] += v.z; }
INNER Vector unit(Vector a) {
    const float inverse = 1.0f / length(a);
    return times(inverse > 0.0f && inverse <= LARGEST ? inverse : 0.0f, a);
}

// Gradient of the corners of the hinge over an edge, from the gradients of its angle in both arcs.
KERNEL(hinges_backward, ELEMENT,
       RING, unsigned back, const unsigned *hinges EACH(4), const unsigned *edge_arcs EACH(2),
       const float *rows, const float *scale ALL(EDGE_WIDTH), OUT double *by_hinge EACH(12)) {
    const unsigned *hinge = hinges + 4 * (size_t)ELEMENT, *arc = edge_arcs + 2 * (size_t)ELEMENT;
    double *out = by_hinge + 12 * (size_t)ELEMENT;
    for (unsigned i = 0; i < 12; ++i) out[i] = 0.0;
#ifdef EDGE_BENDING_ANGLE
    if (hinge[0] == hinge[1]) return;
    const Ring ring = {positions, newest[0], slots, vertices};
    const float *now = frame_of(&ring, back);
    Wide at[4];
    for (unsigned i = 0; i < 4; ++i) {
        const float *p = now + 3 * (size_t)hinge[i];
        const Wide w = {p[0], p[1], p[2]};
        at[i] = w;
    }
    const float both = rows[(size_t)arc[0] * EDGE_WIDTH + EDGE_BENDING_ANGLE] + rows[(size_t)arc[1] * EDGE_WIDTH + EDGE_BENDING_ANGLE];
    const Corners corners = {at[0], at[1], at[2], at[3]};
    angle_slopes(corners, both * scale[EDGE_BENDING_ANGLE], out);
#else
    (void)arc, (void)hinge;
#endif
}

#ifdef NODE_EXTERNAL_FORCE
// Adds the gradient of the drag of the air on one face to that of its corner number `own`. With the
// gradient of the force on all corners u = A/3 sum g: phi = u (rho |v_n| v_n n + c v_t), v_n = n v,
// n = N / |N|.
INNER void face_backward(const float *now, const float *before, const Cloth *cloth, const unsigned *face,
                         float area, Vector sum, unsigned own, Vector *to_now, Vector *to_before) {
    Vector at[3], moved[3];
    for (unsigned c = 0; c < 3; ++c) {
        at[c] = vector(now + 3 * (size_t)face[c]);
        moved[c] = minus(at[c], vector(before + 3 * (size_t)face[c]));
    }
    const float density = cloth->air[3], drag = cloth->air[4], rate = cloth->air[5];
    const Vector wind = minus(vector(cloth->air), times(rate, plus(plus(moved[0], moved[1]), moved[2])));
    const Vector by_b = minus(at[1], at[0]), by_c = minus(at[2], at[0]), across = cross(by_b, by_c);
    const float size = length(across);
    if (size == 0.0f) return;
    const Vector normal = times(1.0f / size, across), force = to_world(cloth->numbers, times(area / 3.0f, sum));
    const float along = dot(normal, wind), slope = (2.0f * density * fabsf(along) - drag) * dot(force, normal);
    const Vector by_wind = plus(times(slope, normal), times(drag, force));
    const Vector by_normal = plus(times(slope, wind), times((density * fabsf(along) - drag) * along, force));
    const Vector by_across = times(1.0f / size, minus(by_normal, times(dot(normal, by_normal), normal)));
    const Vector to_b = cross(by_c, by_across), to_c = cross(by_across, by_b);
    const Vector zero = {0.0f, 0.0f, 0.0f};
    const Vector corner = own == 0 ? minus(minus(zero, to_b), to_c) : own == 1 ? to_b : to_c;
    const Vector by_move = times(-rate, by_wind);
    *to_now = plus(*to_now, plus(corner, by_move));
    *to_before = minus(*to_before, by_move);
}
#endif

// Gradient of one vertex's position in the frame `back` frames before the newest and in the two
// frames before, from the gradients of the features of vertices, arcs
// and hinges in that frame.
KERNEL(positions_backward, ELEMENT,
       FRAME, unsigned back, FORCES,
       const float *nodes EACH(NODE_WIDTH), const float *node_scale ALL(NODE_WIDTH),
       const float *edges, const float *edge_scale ALL(EDGE_WIDTH),
       const unsigned *first_arc, const unsigned *senders, const unsigned *reverse_arcs,
       const unsigned *corner_ends EACH(2), const unsigned *hinge_corners, const double *by_hinge,
       float *gradient ALL(3 * slots * vertices)) {
    const Ring ring = {positions, newest[0], slots, vertices};
    const Ring to = {gradient, newest[0], slots, vertices};
    const float *now = frame_of(&ring, back), *before = frame_of(&ring, back + 1);
    const size_t at = 3 * (size_t)ELEMENT;
    const unsigned cloth_number = cloth_of[ELEMENT];
    const Cloth cloth = {numbers + CLOTH_NUMBERS * cloth_number, air + AIR_NUMBERS * cloth_number};
    const float *row = nodes + (size_t)ELEMENT * NODE_WIDTH;
    const Vector p = vector(now + at), moved = minus(p, vector(before + at)), zero = {0.0f, 0.0f, 0.0f};
    Vector by_now = zero, by_before = zero, by_earlier = zero;
    (void)row, (void)moved;
#ifdef NODE_VELOCITY
    const Vector velocity = to_world(cloth.numbers, row_vector(row, node_scale, NODE_VELOCITY));
    by_now = plus(by_now, velocity);
    by_before = minus(by_before, velocity);
#endif
#ifdef NODE_EXTERNAL_FORCE
    if (cloth.air[3] != 0.0f || cloth.air[4] != 0.0f) {
        for (unsigned i = first_face[ELEMENT]; i < first_face[ELEMENT + 1]; ++i) {
            const unsigned *face = corners + 3 * (size_t)faces[i];
            Vector sum = zero;
            unsigned own = 0;
            for (unsigned c = 0; c < 3; ++c) {
                const float *of_corner = nodes + (size_t)face[c] * NODE_WIDTH;
                sum = plus(sum, row_vector(of_corner, node_scale, NODE_EXTERNAL_FORCE));
                if (face[c] == ELEMENT) own = c;
            }
            face_backward(now, before, &cloth, face, areas[faces[i]], sum, own, &by_now, &by_before);
        }
    }
#endif
#ifdef NODE_KINETIC_ENERGY
    const Vector momentum = times(mass[ELEMENT] * row[NODE_KINETIC_ENERGY] * node_scale[NODE_KINETIC_ENERGY], moved);
    by_now = plus(by_now, momentum);
    by_before = minus(by_before, momentum);
#endif
#ifdef NODE_ACCELERATION
    const Vector acceleration = to_world(cloth.numbers, row_vector(row, node_scale, NODE_ACCELERATION));
    by_now = plus(by_now, acceleration);
    by_before = minus(by_before, times(2.0f, acceleration));
    by_earlier = plus(by_earlier, acceleration);
#endif
    for (size_t arc = first_arc[ELEMENT]; arc < first_arc[ELEMENT + 1]; ++arc) {
        const float *here = edges + arc * EDGE_WIDTH, *there = edges + (size_t)reverse_arcs[arc] * EDGE_WIDTH;
        const Vector along = unit(minus(p, vector(now + 3 * (size_t)senders[arc])));
        float by_length = 0.0f;
        (void)here, (void)there;
#ifdef EDGE_VECTOR
        const Vector local = minus(row_vector(there, edge_scale, EDGE_VECTOR), row_vector(here, edge_scale, EDGE_VECTOR));
        by_now = plus(by_now, to_world(cloth.numbers, local));
        by_length += (there[EDGE_VECTOR + 3] + here[EDGE_VECTOR + 3]) * edge_scale[EDGE_VECTOR + 3];
#endif
#ifdef EDGE_ELONGATION
        by_length += (there[EDGE_ELONGATION] + here[EDGE_ELONGATION]) * edge_scale[EDGE_ELONGATION];
#endif
        by_now = plus(by_now, times(by_length, along));
    }
    for (size_t i = corner_ends[2 * (size_t)ELEMENT]; i < corner_ends[2 * (size_t)ELEMENT + 1]; ++i) {
        const double *slope = by_hinge + 3 * (size_t)hinge_corners[i];
        const Wide w = {slope[0], slope[1], slope[2]};
        by_now = plus(by_now, narrow(w));
    }
    add_to((float *)frame_of(&to, back) + at, by_now);
    add_to((float *)frame_of(&to, back + 1) + at, by_before);
#ifdef NODE_ACCELERATION
    add_to((float *)frame_of(&to, back + 2) + at, by_earlier);
#endif
    (void)by_earlier;
}

// Joins the gradient of a frame's own loss with that of later frames for the positions it predicts.
// Afterwards `gradient` is that of the prediction and `by_next` that of the predicted positions.
KERNEL(join_prediction, ELEMENT,
       float *gradient EACH(3), const unsigned *handle_of EACH(1), const unsigned *cloth_of EACH(1),
       const float *numbers, const float *spread ALL(3), float *by_next EACH(3)) {
    const float *yaw = numbers + CLOTH_NUMBERS * cloth_of[ELEMENT];
    float *row = gradient + 3 * (size_t)ELEMENT, *next = by_next + 3 * (size_t)ELEMENT;
    const Vector zero = {0.0f, 0.0f, 0.0f}, own = vector(row);
    const Vector later = handle_of[ELEMENT] == NO_HANDLE ? vector(next) : zero;
    const Vector local = to_local(yaw, later);
    const Vector inverse = {spread[0] > 0.0f ? own.x / spread[0] : 0.0f, spread[1] > 0.0f ? own.y / spread[1] : 0.0f,
                            spread[2] > 0.0f ? own.z / spread[2] : 0.0f};
    const Vector all = plus(later, to_world(yaw, inverse));
    row[0] = own.x + spread[0] * local.x, row[1] = own.y + spread[1] * local.y, row[2] = own.z + spread[2] * local.z;
    next[0] = all.x, next[1] = all.y, next[2] = all.z;
}

// Integration p' = a + 2 p - p_before: adds the gradient of p' to those of the two frames before.
KERNEL(integration_backward, ELEMENT, const float *by_next EACH(3), float *current EACH(3), float *previous EACH(3)) {
    const size_t at = 3 * (size_t)ELEMENT;
    const Vector g = vector(by_next + at);
    add_to(current + at, times(2.0f, g));
    add_to(previous + at, times(-1.0f, g));
}
