// Normalised features of vertices and arcs, from positions in the world.
//
// NODE_* and EDGE_* are the first columns of the features that a spec has; a feature without one is
// left out. Sums are in the order of the processor's engine.

// External force on a vertex in the local frame [N]: gravity, and a third of the drag of the air on
// each of its faces.
INNER Vector external_force(const float *now, const float *before, const Cloth *cloth, float mass,
                            const unsigned *faces, unsigned count, const unsigned *corners,
                            const float *areas) {
    Vector force = times(mass, vector(cloth->numbers + 2));
    const float density = cloth->air[3], drag = cloth->air[4];
    if (density == 0.0f && drag == 0.0f) return force;
    for (unsigned i = 0; i < count; ++i) {
        const unsigned *face = corners + 3 * faces[i];
        Vector at[3], moved[3];
        for (unsigned c = 0; c < 3; ++c) {
            at[c] = vector(now + 3 * (size_t)face[c]);
            moved[c] = minus(at[c], vector(before + 3 * (size_t)face[c]));
        }
        const Vector sum = plus(plus(moved[0], moved[1]), moved[2]);
        const Vector wind = minus(vector(cloth->air), times(cloth->air[5], sum));
        Vector normal = cross(minus(at[1], at[0]), minus(at[2], at[0]));
        const float inverse = 1.0f / length(normal);
        normal = times(inverse > 0.0f && inverse <= LARGEST ? inverse : 0.0f, normal);
        const float along = dot(normal, wind);
        const Vector tangential = minus(wind, times(along, normal));
        const Vector of_face = plus(times(density * fabsf(along) * along, normal), times(drag, tangential));
        force = plus(force, to_local(cloth->numbers, times(areas[faces[i]] / 3.0f, of_face)));
    }
    return force;
}

// Writes one normalised column of a row; a column without spread is zero.
INNER void put(float *row, const float *shift, const float *scale, unsigned column, float value) {
    row[column] = scale[column] > 0.0f ? (value - shift[column]) * scale[column] : 0.0f;
}

INNER void put_vector(float *row, const float *shift, const float *scale, unsigned column, Vector v) {
    put(row, shift, scale, column, v.x);
    put(row, shift, scale, column + 1, v.y);
    put(row, shift, scale, column + 2, v.z);
}

// Normalises a vector and, in the column after it, its length.
INNER void put_with_length(float *row, const float *shift, const float *scale, unsigned column, Vector v, float of) {
    put_vector(row, shift, scale, column, v);
    put(row, shift, scale, column + 3, of);
}

// Features of one vertex in one frame of the window, [steps, vertices].
KERNEL(node_features, ELEMENT,
       FRAME, unsigned steps, FORCES, const unsigned *handle_of ALL(vertices),
       const float *shift ALL(NODE_WIDTH), const float *scale ALL(NODE_WIDTH), OUT float *out EACH(NODE_WIDTH)) {
    const unsigned step = ELEMENT / vertices, v = ELEMENT % vertices, cloth_number = cloth_of[v];
    const Ring ring = {positions, newest[0], slots, vertices};
    const float *now = frame_of(&ring, steps - 1 - step), *previous = frame_of(&ring, steps - step);
    const Cloth cloth = {numbers + CLOTH_NUMBERS * cloth_number, air + AIR_NUMBERS * cloth_number};
    const Vector p = vector(now + 3 * (size_t)v), q = vector(previous + 3 * (size_t)v);
    float *row = out + (size_t)ELEMENT * NODE_WIDTH;
#ifdef NODE_VELOCITY
    put_vector(row, shift, scale, NODE_VELOCITY, to_local(cloth.numbers, minus(p, q)));
#endif
#ifdef NODE_EXTERNAL_FORCE
    const unsigned first = first_face[v];
    const Vector force = external_force(now, previous, &cloth, mass[v], faces + first,
                                        first_face[v + 1] - first, corners, areas);
    put_vector(row, shift, scale, NODE_EXTERNAL_FORCE, force);
#endif
#ifdef NODE_KINETIC_ENERGY
    const Vector moved = minus(p, q);
    put(row, shift, scale, NODE_KINETIC_ENERGY, 0.5f * mass[v] * dot(moved, moved));
#endif
#ifdef NODE_TYPE
    for (unsigned kind = 0; kind < 9; ++kind) {
        const unsigned of_vertex = handle_of[v] == NO_HANDLE ? 0 : 1;
        put(row, shift, scale, NODE_TYPE + kind, kind == of_vertex ? 1.0f : 0.0f);
    }
#endif
#ifdef NODE_ACCELERATION
    const Vector r = vector(frame_of(&ring, steps - step + 1) + 3 * (size_t)v);
    const Vector acceleration = minus(minus(p, q), minus(q, r));
    put_vector(row, shift, scale, NODE_ACCELERATION, to_local(cloth.numbers, acceleration));
#endif
}

// The bending angle over a hinge (from, to, left, right) [rad], in f32 as the processor computes
// it.
INNER float bending_angle(const float *now, const unsigned *hinge) {
    Vector at[4];
    for (unsigned i = 0; i < 4; ++i) at[i] = vector(now + 3 * (size_t)hinge[i]);
    const Vector along = minus(at[1], at[0]), right = minus(at[3], at[0]);
    const Vector normal_left = cross(along, minus(at[2], at[0])), normal_right = cross(right, along);
    return atan2f(0.0f - length(along) * dot(normal_left, right), dot(normal_left, normal_right));
}

// Features of one arc in one frame of the window, [steps, arcs].
KERNEL(edge_features, ELEMENT,
       RING, unsigned arcs, unsigned steps, const unsigned *cloth_of ALL(vertices), const float *numbers,
       const unsigned *senders ALL(arcs), const unsigned *receivers ALL(arcs), const float *arc_rest ALL(4 * arcs),
       const float *arc_material ALL(3 * arcs), const unsigned *hinges ALL(4 * arcs),
       const float *shift ALL(EDGE_WIDTH), const float *scale ALL(EDGE_WIDTH), OUT float *out EACH(EDGE_WIDTH)) {
    const unsigned step = ELEMENT / arcs, arc = ELEMENT % arcs;
    const Ring ring = {positions, newest[0], slots, vertices};
    const float *now = frame_of(&ring, steps - 1 - step);
    const float *yaw = numbers + CLOTH_NUMBERS * cloth_of[receivers[arc]];
    const Vector apart = minus(vector(now + 3 * (size_t)senders[arc]), vector(now + 3 * (size_t)receivers[arc]));
    const float *at_rest = arc_rest + 4 * (size_t)arc;
    float *row = out + (size_t)ELEMENT * EDGE_WIDTH;
    const Vector local = to_local(yaw, apart);
#ifdef EDGE_VECTOR
    put_with_length(row, shift, scale, EDGE_VECTOR, local, length(local));
#endif
#ifdef EDGE_REST_VECTOR
    put_with_length(row, shift, scale, EDGE_REST_VECTOR, vector(at_rest), at_rest[3]);
#endif
#ifdef EDGE_MATERIAL_VECTOR
    put_vector(row, shift, scale, EDGE_MATERIAL_VECTOR, vector(arc_material + 3 * (size_t)arc));
#endif
#ifdef EDGE_ELONGATION
    put(row, shift, scale, EDGE_ELONGATION, length(apart) - at_rest[3]);
#endif
#ifdef EDGE_BENDING_ANGLE
    const unsigned *hinge = hinges + 4 * (size_t)arc;
    put(row, shift, scale, EDGE_BENDING_ANGLE, hinge[0] == hinge[1] ? 0.0f : bending_angle(now, hinge));
#endif
}
