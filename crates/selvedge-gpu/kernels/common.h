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
