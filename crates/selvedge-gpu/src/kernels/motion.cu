// Integration of accelerations to the next positions.

// p' = a + 2 p - p_before for one vertex; a handle goes to its target. Writes the slot after the
// newest of the ring.
KERNEL(integrate, ELEMENT,
       float *positions ALL(3 * slots * vertices), const unsigned *newest ALL(1), unsigned slots, unsigned vertices,
       const float *output EACH(3), const float *shift ALL(3), const float *spread ALL(3), const float *numbers,
       const unsigned *cloth_of EACH(1), const unsigned *handle_of EACH(1), const float *targets) {
    const unsigned v = ELEMENT;
    const Ring ring = {positions, newest[0], slots, vertices};
    const float *yaw = numbers + CLOTH_NUMBERS * cloth_of[v];
    const Vector p = vector(frame_of(&ring, 0) + 3 * (size_t)v), q = vector(frame_of(&ring, 1) + 3 * (size_t)v);
    const float *predicted = output + 3 * (size_t)v;
    Vector a;
    a.x = predicted[0] * spread[0] + shift[0];
    a.y = predicted[1] * spread[1] + shift[1];
    a.z = predicted[2] * spread[2] + shift[2];
    Vector next = plus(to_world(yaw, a), minus(times(2.0f, p), q));
    if (handle_of[v] != NO_HANDLE) next = vector(targets + 3 * (size_t)handle_of[v]);
    float *to = positions + ((size_t)((newest[0] + 1) % slots) * vertices + v) * 3;
    to[0] = next.x;
    to[1] = next.y;
    to[2] = next.z;
}
