// Definitions for the C compiler of this machine: one lane, one thread.
#include <math.h>
#include <stddef.h>
#define INNER static inline
#define LANES 1u
#define LANE 0u
#define THREADS 1u
#define THREAD 0u
#define BARRIER ((void)0)
#define SUM_OVER_LANES(x) (x)
#define SUM_DOUBLES_OVER_LANES(x) (x)
#define UNROLL
