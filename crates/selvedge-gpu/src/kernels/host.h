// Definitions for the C compiler of this machine: one lane.
#include <math.h>
#include <stddef.h>
#define INNER static inline
#define LANES 1u
#define LANE 0u
#define SUM_OVER_LANES(x) (x)
#define SUM_DOUBLES_OVER_LANES(x) (x)
#define UNROLL
