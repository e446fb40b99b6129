// Definitions for NVRTC: a row is a warp, its lanes are the threads of the warp.
#define INNER static __device__ __forceinline__
#define LANES 32u
#define LANE (threadIdx.x & 31u)
#define UNROLL _Pragma("unroll")
// The same on every lane, to the last bit: each step adds the same two numbers on both sides.
INNER float sum_over_lanes(float x) {
    for (int apart = 16; apart > 0; apart /= 2) x += __shfl_xor_sync(0xffffffffu, x, apart);
    return x;
}
#define SUM_OVER_LANES(x) sum_over_lanes(x)
INNER double sum_doubles_over_lanes(double x) {
    for (int apart = 16; apart > 0; apart /= 2) x += __shfl_xor_sync(0xffffffffu, x, apart);
    return x;
}
#define SUM_DOUBLES_OVER_LANES(x) sum_doubles_over_lanes(x)
