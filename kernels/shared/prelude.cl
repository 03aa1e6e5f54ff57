/* What every program begins with: the types of numbers, arithmetic that rounds the same in all variants, and the flags
 * of cells. The structure parameter_set follows, see persfs_cl/_cl/parameters.py, and then what kernels/README.md says.
 *
 * USE_DOUBLE  0 or 1: the real type.
 * LANES       1, 2, 4, 8 or 16, the last not in kernels/energy: how many cells a work-item updates at once. `number` is
 *             a real for each lane, `integer` an integer of the same width. At most as many as a vector register holds:
 *             see registers.cl.
 * REACH       1 or 2: how many neighbours a cell reads on every side; 2 for differences of second order.
 * ONLY_LOWER  0 or 1: whether values only fall; 0 for the correction to second order, and what is accelerated.
 * LIMITS      0, 1 or 2: how many bounds values have; none, one from below, or one from below and one from above, which
 *             only values need that may rise: others stay below what they begin with.
 * FUSED       1: multiply-add is the built-in fma; 0: a product and a sum that the compiler contracts, for drivers in
 *             which fma is a function call.
 * BUILTINS    1: the compiler's own functions for square root, prefetch and fence, which OpenCL C lacks or which are
 *             function calls there.
 *
 * Contraction is off elsewhere and every fused multiply-add is written out, so that two orderings compiled from the
 * same cell update give the same bits on a device.
 */
#ifndef REACH
#define REACH 1
#endif
#ifndef ONLY_LOWER
#define ONLY_LOWER 1
#endif
#ifndef LIMITS
#define LIMITS 0
#endif

#if USE_DOUBLE
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define REAL double
#define INTEGER long
#else
#define REAL float
#define INTEGER int
#endif

#define JOINED(a, b) a##b
#define JOIN(a, b) JOINED(a, b)
#if LANES > 1
#define WIDE(scalar) JOIN(scalar, LANES)
#else
#define WIDE(scalar) scalar
#endif

typedef REAL real;
typedef WIDE(REAL) number;
typedef WIDE(INTEGER) integer;
#define as_integer JOIN(as_, WIDE(INTEGER))
#define as_number JOIN(as_, WIDE(REAL))

/* A number that depends on the side of the upwind neighbours. At first order that is the side which the sweep comes
 * from, the same for all lanes; at second order each lane has its own.
 */
#if REACH == 2
typedef number sided;
#else
typedef real sided;
#endif

/* Vectors at any address. */
#if LANES > 1
typedef number unaligned __attribute__((aligned(sizeof(real))));
#define LOAD(from) (*(__global const unaligned *)(from))
#define STORE(to, value) (*(__global unaligned *)(to) = (value))
#else
#define LOAD(from) (*(from))
#define STORE(to, value) (*(to) = (value))
#endif

/* The elements 0, `apart`, 2 apart, ... of `from`, one for each lane; convert_ would be a function call. */
#if LANES == 16
#define GATHER(wide, from, apart)                                                                                      \
    ((wide)((from)[0], (from)[apart], (from)[2 * (apart)], (from)[3 * (apart)], (from)[4 * (apart)],                   \
            (from)[5 * (apart)], (from)[6 * (apart)], (from)[7 * (apart)], (from)[8 * (apart)], (from)[9 * (apart)],   \
            (from)[10 * (apart)], (from)[11 * (apart)], (from)[12 * (apart)], (from)[13 * (apart)],                    \
            (from)[14 * (apart)], (from)[15 * (apart)]))
#elif LANES == 8
#define GATHER(wide, from, apart)                                                                                      \
    ((wide)((from)[0], (from)[apart], (from)[2 * (apart)], (from)[3 * (apart)], (from)[4 * (apart)],                   \
            (from)[5 * (apart)], (from)[6 * (apart)], (from)[7 * (apart)]))
#elif LANES == 4
#define GATHER(wide, from, apart) ((wide)((from)[0], (from)[apart], (from)[2 * (apart)], (from)[3 * (apart)]))
#elif LANES == 2
#define GATHER(wide, from, apart) ((wide)((from)[0], (from)[apart]))
#else
#define GATHER(wide, from, apart) ((wide)(from)[0])
#endif

#pragma OPENCL FP_CONTRACT OFF

#if FUSED
#define FUSED_MULTIPLY_ADD fma
#else
static inline number contracted(const number a, const number b, const number c)
{
#pragma OPENCL FP_CONTRACT ON
    return a * b + c;
}
#define FUSED_MULTIPLY_ADD contracted
#endif
#define multiply_add(a, b, c) FUSED_MULTIPLY_ADD((number)(a), (number)(b), (number)(c))
#define fnma(a, b, c) FUSED_MULTIPLY_ADD(-(number)(a), (number)(b), (number)(c))

/* In each lane a where the condition holds, b elsewhere. As in multiply_add, a b + c, and in fnma, c - a b, a scalar
 * stands for all lanes; the operator ?: wants two of the same type.
 */
#define choose(condition, a, b) ((condition) ? (number)(a) : (number)(b))

#if BUILTINS && USE_DOUBLE
#define ROOT __builtin_sqrt
#elif BUILTINS
#define ROOT __builtin_sqrtf
#else
#define ROOT sqrt
#endif

/* Other work-groups see what was written before this before what is written after it, and likewise for reads. In PoCL
 * mem_fence does nothing, and not every atomic operation is such a fence itself.
 */
#if BUILTINS
#define FENCE() __atomic_thread_fence(__ATOMIC_ACQ_REL)
#else
#define FENCE() mem_fence(CLK_GLOBAL_MEM_FENCE)
#endif

#if BUILTINS
#define PREFETCH(address) __builtin_prefetch((__global const void *)(address))
#else
#define PREFETCH(address)
#endif

static inline number root(const number a)
{
#if LANES == 16 && BUILTINS
    return (number)(ROOT(a.s0), ROOT(a.s1), ROOT(a.s2), ROOT(a.s3), ROOT(a.s4), ROOT(a.s5), ROOT(a.s6), ROOT(a.s7),
                    ROOT(a.s8), ROOT(a.s9), ROOT(a.sa), ROOT(a.sb), ROOT(a.sc), ROOT(a.sd), ROOT(a.se), ROOT(a.sf));
#elif LANES == 8 && BUILTINS
    return (number)(ROOT(a.s0), ROOT(a.s1), ROOT(a.s2), ROOT(a.s3), ROOT(a.s4), ROOT(a.s5), ROOT(a.s6), ROOT(a.s7));
#elif LANES == 4 && BUILTINS
    return (number)(ROOT(a.s0), ROOT(a.s1), ROOT(a.s2), ROOT(a.s3));
#elif LANES == 2 && BUILTINS
    return (number)(ROOT(a.s0), ROOT(a.s1));
#else
    return ROOT(a);
#endif
}

/* Plain comparisons: one instruction, where fmin and fmax handle NaN. A NaN in `a` gives b. */
static inline number least(const number a, const number b)
{
    return a < b ? a : b;
}

static inline number most(const number a, const number b)
{
    return a > b ? a : b;
}

static inline number magnitude(const number a)
{
    return most(a, -a);
}

/* 1 - E^2: the square of the sine between normal and light, where E is the cosine. Written so that the NaN of a cell
 * that is not swept stays one.
 */
static inline number darkness(const number brightness)
{
    return most(0, (1 - brightness) * (1 + brightness));
}

/* Whether the sign bit of any lane is set. */
static inline int any_sign(const integer bits)
{
#if LANES > 1
#if LANES == 16
    const JOIN(INTEGER, 8) eight = bits.lo | bits.hi;
    const JOIN(INTEGER, 4) four = eight.lo | eight.hi;
    const JOIN(INTEGER, 2) two = four.lo | four.hi;
#elif LANES == 8
    const JOIN(INTEGER, 4) four = bits.lo | bits.hi;
    const JOIN(INTEGER, 2) two = four.lo | four.hi;
#elif LANES == 4
    const JOIN(INTEGER, 2) two = bits.lo | bits.hi;
#else
    const integer two = bits;
#endif
#if USE_DOUBLE
    return (two.x | two.y) < 0;
#else
    return (as_ulong(two) & 0x8000000080000000UL) != 0;
#endif
#else
    return bits < 0;
#endif
}

/* The value of a cell that is missing: so high that it is never the upwind one. Finite, so that its difference from
 * itself is 0.
 */
#define NOWHERE ((real)1e30f)

/* What a new value must lie below. */
static inline number bound_of(const number here)
{
    return choose(ONLY_LOWER, here, 0.5f * NOWHERE);
}

/* Bounds of the values of cells, NaN where there is none: the lower are read where LIMITS is 1 or 2, the upper where it
 * is 2.
 */
typedef struct {
    __global const real *lower, *upper;
} bounds;

/* Those from the cell `begin` on, where the bounds of all cells from below, so many in all, come before the others. */
static inline bounds bounds_from(__global const real *limits, const size_t all_cells, const size_t begin)
{
    const bounds result = {limits + begin, limits + (LIMITS > 1 ? all_cells + begin : begin)};
    return result;
}

/* `value` within as many bounds as LIMITS says. */
static inline number limited(const number value, const number *limits)
{
    /* Written so that a NaN stays one, whatever the bounds, and that a bound which is NaN is none. */
    number result = value;
#if LIMITS > 0
    result = limits[0] > result ? limits[0] : result;
#endif
#if LIMITS > 1
    result = limits[1] < result ? limits[1] : result;
#endif
    return result;
}

/* Flags of a cell. A neighbour is missing where the image or the mask ends, or where a wall stands. */
#define SWEPT 1
#define NO_LEFT 2
#define NO_RIGHT 4
#define NO_UP 8
#define NO_DOWN 16

/* A gradient or a normal: a component along x and one along y. */
typedef struct {
    number p, q;
} slopes;

/* Numbers of the columns or rows of the lanes, from a table made on the host. */
typedef struct {
    number coordinate; /* x or y                                                             */
    number root;       /* sqrt(1 + x^2) / (2 dx), likewise for y: for the model's viscosity  */
    number offset;     /* |x - p0| / (2 k dx), likewise for y                                */
} axis;

#if LANES == 1
/* Those of column or row `index`; the table holds `length` coordinates, as many roots and as many offsets. */
static inline axis axis_at(__global const real *table, const int length, const int index)
{
    const axis result = {table[index], table[length + index], table[2 * length + index]};
    return result;
}
#endif

/* Whether an image of this run has met its tolerance: its cells then stay as they are. `changes` holds max |dZ| of the
 * iterations that were queued together, shape (iterations, images).
 */
static inline int finished(__global const float *changes, const int iteration, const int image, const int images,
                           const float tolerance)
{
    return iteration > 0 && changes[(iteration - 1) * images + image] <= tolerance;
}
