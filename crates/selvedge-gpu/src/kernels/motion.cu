// Integration of accelerations to the next positions, and the bounds of edge lengths.

// p' = a + 2 p - reference for one vertex; a handle goes to its target. Writes the slot after the
// newest of the ring.
KERNEL(integrate, ELEMENT,
       float *positions ALL(3 * slots * vertices), const unsigned *newest ALL(1), unsigned slots, unsigned vertices,
       const float *output EACH(3), const float *shift ALL(3), const float *spread ALL(3), const float *numbers,
       const double *carries, const unsigned *cloth_of EACH(1), const float *rest EACH(3),
       const unsigned *handle_of EACH(1), const float *targets) {
    const unsigned v = ELEMENT, cloth_number = cloth_of[v];
    const Ring ring = {positions, newest[0], slots, vertices};
    const float *yaw = numbers + CLOTH_NUMBERS * cloth_number;
    const Vector p = vector(frame_of(&ring, 0) + 3 * (size_t)v), q = vector(frame_of(&ring, 1) + 3 * (size_t)v);
    const Vector from = reference(carries + (size_t)cloth_number * 24, q, p, vector(rest + 3 * (size_t)v));
    const float *predicted = output + 3 * (size_t)v;
    Vector a;
    a.x = predicted[0] * spread[0] + shift[0];
    a.y = predicted[1] * spread[1] + shift[1];
    a.z = predicted[2] * spread[2] + shift[2];
    Vector next = plus(to_world(yaw, a), minus(times(2.0f, p), from));
    if (handle_of[v] != NO_HANDLE) next = vector(targets + 3 * (size_t)handle_of[v]);
    float *to = positions + ((size_t)((newest[0] + 1) % slots) * vertices + v) * 3;
    to[0] = next.x;
    to[1] = next.y;
    to[2] = next.z;
}

#ifdef SWEEPS
// Brings the edges of one cloth back to their bounds, colour after colour; no two edges of a colour
// share a vertex. Ends when a sweep finds no edge out of bounds, or after SWEEPS sweeps.
KERNEL(limit_edges, BLOCK,
       float *positions ALL(3 * slots * vertices), const unsigned *newest ALL(1), unsigned slots, unsigned vertices,
       const unsigned *edge_ends, const float *edge_rest, const float *inverse_mass ALL(vertices), const unsigned *colour_bounds,
       unsigned colours, unsigned *changed EACH(1)) {
    float *at = positions + (size_t)((newest[0] + 1) % slots) * vertices * 3;
    const unsigned *bounds = colour_bounds + (size_t)BLOCK * (colours + 1);
    volatile unsigned *found = changed + BLOCK;
    for (unsigned sweep = 0; sweep < SWEEPS; ++sweep) {
        if (THREAD == 0) *found = 0;
        BARRIER;
        for (unsigned colour = 0; colour < colours; ++colour) {
            for (unsigned edge = bounds[colour] + THREAD; edge < bounds[colour + 1]; edge += THREADS) {
                float *a = at + 3 * (size_t)edge_ends[2 * edge], *b = at + 3 * (size_t)edge_ends[2 * edge + 1];
                const float of_a = inverse_mass[edge_ends[2 * edge]], of_b = inverse_mass[edge_ends[2 * edge + 1]];
                const Vector apart = minus(vector(a), vector(b));
                const float long_now = length(apart), least = LEAST_STRETCH * edge_rest[edge];
                const float most = MOST_STRETCH * edge_rest[edge];
                const float wanted = long_now < least ? least : long_now > most ? most : long_now;
                // The slack is the rounding of lengths of f32 positions about 1 m from the origin.
                // What is not finite is left for the step to report.
                const int off = fabsf(wanted - long_now) > 1e-5f * edge_rest[edge] && long_now <= LARGEST;
                if (!off || of_a + of_b == 0.0f || long_now == 0.0f) continue;
                const Vector change = times((wanted - long_now) / (long_now * (of_a + of_b)), apart);
                const Vector new_a = plus(vector(a), times(of_a, change));
                const Vector new_b = minus(vector(b), times(of_b, change));
                a[0] = new_a.x, a[1] = new_a.y, a[2] = new_a.z;
                b[0] = new_b.x, b[1] = new_b.y, b[2] = new_b.z;
                *found = 1;
            }
            BARRIER;
        }
        const unsigned any = *found;
        BARRIER;
        if (!any) break;
    }
}
#endif
