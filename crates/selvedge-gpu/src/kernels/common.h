// Definitions that all kernels share.
//
// KERNEL(name, shape, parameters...) begins a kernel. Its body works on one element or one row and
// finds the number of it in ELEMENT or ROW. The signature is also what the host program knows of a
// kernel (signature.rs reads it): an array is read where it is const, written as a whole where it
// is marked OUT, and read and written otherwise. MAYBE marks an array that may be null. EACH(width)
// is the number of elements per element or row of a launch, ALL(width) that of the whole array; a
// width is a product of a number, sizes of the network, and counts of the launch.
#define KERNEL(name, shape, ...) INNER void of_##name(const unsigned shape, __VA_ARGS__)
#define OUT
#define MAYBE
#define EACH(width)
#define ALL(width)

// Lists of parameters that several kernels have, one line each.
// The last frames of positions, [slots, vertices, 3]; slot newest[0] is the newest.
#define RING const float *positions ALL(3 * slots * vertices), const unsigned *newest ALL(1), unsigned slots, unsigned vertices
// A ring, and the numbers of the cloths in the frame: the cloth of each vertex, and local frames.
#define FRAME RING, const unsigned *cloth_of ALL(vertices), const float *numbers
// Forces on vertices: air and masses, the faces of each vertex, corners and areas of the faces.
#define FORCES const float *air, const float *mass ALL(vertices), const unsigned *first_face, const unsigned *faces, const unsigned *corners, const float *areas
// A prediction, the three frames it is judged by, the handles, and the constants of the losses.
#define JUDGED const float *predicted EACH(3), const double *previous EACH(3), const double *current EACH(3), const double *target EACH(3), const unsigned *handle_of EACH(1), const double *numbers ALL(19)

// Row ROW of an array with rows of `width`.
#define ROW_OF(array, width) ((array) + (size_t)ROW * (width))
// The columns of a latent row that belong to this lane: the j-th of them is column k.
#define PER_LANE ((LATENT + LANES - 1) / LANES)
#define FOR_COLUMNS(j, k) UNROLL for (unsigned j = 0, k = LANE; j < PER_LANE; ++j, k += LANES) if (LATENT % LANES == 0 || k < LATENT)
// Added to a variance before its root, as in PyTorch.
#define NORM_EPSILON 1e-5f

INNER float relu(float x) { return x > 0.0f ? x : 0.0f; }

// e^{-x} overflows to infinity where x is very negative, and the quotient is 0 then, as it should
// be.
INNER float sigmoid(float x) { return 1.0f / (1.0f + expf(-x)); }

// The largest finite float.
#define LARGEST 3.4028235e38f
// The handle number of a vertex that is no handle.
#define NO_HANDLE 0xffffffffu
// Numbers of a cloth in a frame: cosine and sine of its yaw, gravity in the local frame.
#define CLOTH_NUMBERS 5
// Numbers of the air around a cloth: wind, density, drag, and the frame rate over three, which
// takes the sum of the moves of three corners to their mean velocity.
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

// Rotations about the vertical; `yaw` is the cosine and the sine of the local frame.
INNER Vector to_local(const float *yaw, Vector world) {
    const Vector v = {yaw[0] * world.x - yaw[1] * world.z, world.y, yaw[1] * world.x + yaw[0] * world.z};
    return v;
}
INNER Vector to_world(const float *yaw, Vector local) {
    const Vector v = {yaw[0] * local.x + yaw[1] * local.z, local.y, yaw[0] * local.z - yaw[1] * local.x};
    return v;
}

// Positions `back` frames before the newest.
INNER const float *frame_of(const Ring *ring, unsigned back) {
    const unsigned slot = (ring->newest + ring->slots - back) % ring->slots;
    return ring->positions + (size_t)slot * ring->vertices * 3;
}

INNER Vector narrow(Wide w) {
    const Vector v = {(float)w.x, (float)w.y, (float)w.z};
    return v;
}
