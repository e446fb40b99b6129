// What every kernel may use. KERNEL(name) begins a kernel; its parameters stand in the table beside it.
#define KERNEL(name) SIGNATURE_##name
// Where row ROW of an array with rows of `width` begins.
#define ROW_OF(array, width) ((array) + (size_t)ROW * (width))
// The columns of a latent row that this lane takes: the j-th of them is number k.
#define PER_LANE ((LATENT + LANES - 1) / LANES)
#define FOR_COLUMNS(j, k) UNROLL for (unsigned j = 0, k = LANE; j < PER_LANE; ++j, k += LANES) if (LATENT % LANES == 0 || k < LATENT)
// Added to a variance before its root, as in PyTorch.
#define NORM_EPSILON 1e-5f

INNER float relu(float x) { return x > 0.0f ? x : 0.0f; }

// e^{-x} overflows to infinity where x is very negative, and the quotient is 0 then, as it should be.
INNER float sigmoid(float x) { return 1.0f / (1.0f + expf(-x)); }

// What is greater is not finite.
#define LARGEST 3.4028235e38f
// Of a vertex that is no handle.
#define NO_HANDLE 0xffffffffu
// Numbers of a cloth in a frame: cosine and sine of its yaw, gravity in the local frame.
#define CLOTH_NUMBERS 5
// Numbers of the air around a cloth: wind, density, drag, from the way of three corners to their rate.
#define AIR_NUMBERS 6

typedef struct { float x, y, z; } Vector;
typedef struct { double x, y, z; } Wide;
typedef struct { const float *numbers, *air; } Cloth;
// The last frames of positions, [slots, vertices, 3].
typedef struct { const float *positions; unsigned newest, slots, vertices; } Ring;

INNER Vector vector(const float *at) {
    const Vector v = {at[0], at[1], at[2]};
    return v;
}
INNER Vector plus(Vector a, Vector b) {
    const Vector v = {a.x + b.x, a.y + b.y, a.z + b.z};
    return v;
}
INNER Vector minus(Vector a, Vector b) {
    const Vector v = {a.x - b.x, a.y - b.y, a.z - b.z};
    return v;
}
INNER Vector times(float s, Vector a) {
    const Vector v = {s * a.x, s * a.y, s * a.z};
    return v;
}
INNER float dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INNER Vector cross(Vector a, Vector b) {
    const Vector v = {a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y};
    return v;
}
INNER float length(Vector a) { return sqrtf(dot(a, a)); }

// A turn about the vertical: `yaw` is its cosine and sine.
INNER Vector to_local(const float *yaw, Vector world) {
    const Vector v = {yaw[0] * world.x - yaw[1] * world.z, world.y, yaw[1] * world.x + yaw[0] * world.z};
    return v;
}
INNER Vector to_world(const float *yaw, Vector local) {
    const Vector v = {yaw[0] * local.x + yaw[1] * local.z, local.y, yaw[0] * local.z - yaw[1] * local.x};
    return v;
}

// Positions so many frames before the newest.
INNER const float *frame_of(const Ring *ring, unsigned back) {
    const unsigned slot = (ring->newest + ring->slots - back) % ring->slots;
    return ring->positions + (size_t)slot * ring->vertices * 3;
}

// Where a rigid motion (from, to, cosine and sine of the turn) takes a point.
INNER Wide carried(const double *carry, Vector point) {
    const double x = point.x - carry[0], y = point.y - carry[1], z = point.z - carry[2];
    const Wide w = {carry[3] + (carry[6] * x + carry[7] * z), carry[4] + y, carry[5] + (carry[6] * z - carry[7] * x)};
    return w;
}
INNER Vector narrow(Wide w) {
    const Vector v = {(float)w.x, (float)w.y, (float)w.z};
    return v;
}

#ifdef CARRIED
INNER float reference_of(double here, double before, double rest, float now) {
    const double there = here + (1.0 - DAMPING) * (here - before) + STIFFNESS * (rest - here);
    return (float)(2.0 * now - there);
}
#endif

// The position one frame earlier from which uniform motion would lead where the cloth goes by itself;
// `carries` are those of the handles from now, from before and from rest to where they go.
INNER Vector reference(const double *carries, Vector before, Vector now, Vector rest) {
#ifdef CARRIED
    const Wide here = carried(carries, now), old = carried(carries + 8, before), home = carried(carries + 16, rest);
    const Vector v = {reference_of(here.x, old.x, home.x, now.x), reference_of(here.y, old.y, home.y, now.y),
                      reference_of(here.z, old.z, home.z, now.z)};
    return v;
#else
    (void)carries, (void)now, (void)rest;
    return before;
#endif
}
