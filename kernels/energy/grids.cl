/* Coarser grids, which hasten the method of conjugate gradients: the remainder is added up on grids of twice, four
 * times, ... the spacing, divided there by about the diagonal that the matrix has there, and interpolated back (additive
 * multilevel preconditioning, Bramble, Pasciak and Xu 1990).
 *
 * A pixel of a coarse grid is a square of four of the finer one. A value is interpolated linearly between the middles of
 * squares, from nine, three and three sixteenths and one sixteenth of four of them; beyond the edge they are 0. Adding up
 * is the transposed of that, so that the whole is symmetric. Global size (work-items of a row, height), of the coarse
 * grid where there are two. All arrays are padded. Where 1 over the diagonal is 0 nothing goes into a grid and nothing
 * comes from it: it ends there.
 */

#if LANES > 1
#if LANES == 2
typedef real half_number;
#define HALF_LOAD(from) (*(from))
#define ALTERNATELY(a, b) ((number)(a, b))
#else
#if LANES == 4
typedef JOIN(REAL, 2) half_number;
#define ALTERNATELY(a, b) ((number)((a).x, (b).x, (a).y, (b).y))
#else
typedef JOIN(REAL, 4) half_number;
#define ALTERNATELY(a, b) ((number)((a).x, (b).x, (a).y, (b).y, (a).z, (b).z, (a).w, (b).w))
#endif
typedef half_number unaligned_half __attribute__((aligned(sizeof(real))));
#define HALF_LOAD(from) (*(__global const unaligned_half *)(from))
#endif
#endif

/* Values at LANES pixels of the finer grid, the first in an even column where they are several. */
static inline number interpolated(__global const real *coarse, const int column, const int row, const int coarse_stride)
{
    __global const real *near = coarse + cell_at(column / 2, row / 2, coarse_stride);
    __global const real *next = row & 1 ? near + coarse_stride : near - coarse_stride;
#if LANES > 1
    const half_number before = (real)0.75f * HALF_LOAD(near - 1) + (real)0.25f * HALF_LOAD(next - 1);
    const half_number middle = (real)0.75f * HALF_LOAD(near) + (real)0.25f * HALF_LOAD(next);
    const half_number behind = (real)0.75f * HALF_LOAD(near + 1) + (real)0.25f * HALF_LOAD(next + 1);
    const half_number even = (real)0.75f * middle + (real)0.25f * before;
    const half_number odd = (real)0.75f * middle + (real)0.25f * behind;
    return ALTERNATELY(even, odd);
#else
    const int beside = column & 1 ? 1 : -1;
    return 0.75f * (0.75f * near[0] + 0.25f * next[0]) + 0.25f * (0.75f * near[beside] + 0.25f * next[beside]);
#endif
}

/* What LANES columns of the finer grid add to a coarse row. */
static inline number added_rows(__global const real *fine, const size_t line)
{
    return 0.25f * (LOAD(fine - line) + LOAD(fine + 2 * line)) + 0.75f * (LOAD(fine) + LOAD(fine + line));
}

/* The sums for LANES pixels of the coarse grid. */
static inline number added_up(__global const real *fine, const size_t line)
{
#if LANES > 1
    const number first = added_rows(fine, line), second = added_rows(fine + LANES, line);
    const number first_before = added_rows(fine - 2, line), second_before = added_rows(fine + LANES - 2, line);
    const number first_behind = added_rows(fine + 2, line), second_behind = added_rows(fine + LANES + 2, line);
    const number even = (number)(first.even, second.even), odd = (number)(first.odd, second.odd);
    const number before = (number)(first_before.odd, second_before.odd);
    const number behind = (number)(first_behind.even, second_behind.even);
#else
    const number even = added_rows(fine, line), odd = added_rows(fine + 1, line);
    const number before = added_rows(fine - 1, line), behind = added_rows(fine + 2, line);
#endif
    return 0.25f * (before + behind) + 0.75f * (even + odd);
}

/* A row of the remainder on the next grid. */
static inline void restrict_row(__global const real *remainder, __global const real *coarse_inverse_diagonal,
                                __global real *coarse_remainder, const int row, const int width, const int stride,
                                const int coarse_stride)
{
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, coarse_stride);
        const number sum = added_up(remainder + cell_at(2 * column, 2 * row, stride), (size_t)stride);
        STORE(coarse_remainder + cell, choose(LOAD(coarse_inverse_diagonal + cell) > 0, sum, 0));
    }
}

/* A row of the correction on a grid: the remainder there by about the diagonal, and what comes from the next coarser
 * grid, if there is one.
 */
static inline void correct_row(__global const real *remainder, __global const real *inverse_diagonal,
                               __global const real *coarse_correction, __global real *correction, const int row,
                               const int has_coarser, const int width, const int stride, const int coarse_stride)
{
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, stride);
        const number inverse = LOAD(inverse_diagonal + cell);
        number result = inverse * LOAD(remainder + cell);
        if (has_coarser)
            result += interpolated(coarse_correction, column, row, coarse_stride);
        STORE(correction + cell, choose(inverse > 0, result, 0));
    }
}

/* The remainder on the next grid. */
__kernel void restrict_remainder(__global const real *remainder,  /* of the finer grid         */
                                 __global const real *coarse_inverse_diagonal, /* 0 for nothing */
                                 __global real *coarse_remainder, /* result                    */
                                 const int coarse_width,          /* pixels                    */
                                 const int stride,                /* of the finer grid         */
                                 const int coarse_stride)         /* of the coarse one         */
{
    restrict_row(remainder, coarse_inverse_diagonal, coarse_remainder, (int)get_global_id(1), coarse_width, stride,
                 coarse_stride);
}

/* The correction on a grid. */
__kernel void correct_grid(__global const real *remainder,         /* of this grid                         */
                           __global const real *inverse_diagonal,  /* of this grid                         */
                           __global const real *coarse_correction, /* of the next one                      */
                           __global real *correction,              /* result                               */
                           const int has_coarser,                  /* 0 for the last grid                  */
                           const int width,                        /* pixels                               */
                           const int stride,                       /* of this grid                         */
                           const int coarse_stride)                /* of the next one                      */
{
    correct_row(remainder, inverse_diagonal, coarse_correction, correction, (int)get_global_id(1), has_coarser, width,
                stride, coarse_stride);
}

/* Both on all small grids, the first of which has its remainder: a launch for each would take longer than its work. One
 * work-group does all of it, global size (work-items of a row, 1). The arrays of the grids lie one behind the other.
 */
__kernel void correct_small_grids(__global const int *small_grids, /* width, height, stride, and where the arrays of
                                                                      each begin, from fine to coarse           */
                                  const int small_count,           /* of them, at least 1                       */
                                  __global const real *small_inverse_diagonals,
                                  __global real *small_remainders,   /* results but for the first               */
                                  __global real *small_corrections)  /* results                                 */
{
    for (int place = 1; place < small_count; ++place) {
        __global const int *own = small_grids + 4 * place, *finer = own - 4;
        for (int row = 0; row < own[1]; ++row)
            restrict_row(small_remainders + finer[3], small_inverse_diagonals + own[3], small_remainders + own[3], row,
                         own[0], finer[2], own[2]);
        barrier(CLK_GLOBAL_MEM_FENCE);
    }
    for (int place = small_count - 1; place >= 0; --place) {
        const int has_coarser = place + 1 < small_count;
        __global const int *own = small_grids + 4 * place, *coarser = own + 4 * has_coarser;
        for (int row = 0; row < own[1]; ++row)
            correct_row(small_remainders + own[3], small_inverse_diagonals + own[3], small_corrections + coarser[3],
                        small_corrections + own[3], row, has_coarser, own[0], own[2], coarser[2]);
        barrier(CLK_GLOBAL_MEM_FENCE);
    }
}

/* About the diagonal of the matrix on the next grid. Slopes of a function that is twice as wide are half as large, and
 * there are four times as many of them; second differences are a quarter as large; what the prior says of values is added.
 */
__kernel void coarsen_diagonal(__global const real *diagonal_parts,   /* three planes, of the finer grid           */
                               __global real *coarse_diagonal_parts,  /* three planes, result                      */
                               __global real *coarse_inverse_diagonal, /* result                                   */
                               const int height,                      /* pixels of the finer grid                  */
                               const int stride,                      /* of the finer grid                         */
                               const int coarse_width,                /* pixels                                    */
                               const int coarse_height,               /* pixels                                    */
                               const int coarse_stride)               /* of the coarse grid                        */
{
    const real shares[3] = {0.25f, 0.0625f, 1};
    const int row = (int)get_global_id(1);
    const size_t line = (size_t)stride, plane = line * (size_t)(height + 2 * PAD);
    const size_t coarse_plane = (size_t)coarse_stride * (size_t)(coarse_height + 2 * PAD);
    /* One pixel after another, on any device: beyond the edge nothing must be written. */
    for (int column = (int)get_global_id(0); column < coarse_width; column += (int)get_global_size(0)) {
        const size_t from = cell_at(2 * column, 2 * row, stride), to = cell_at(column, row, coarse_stride);
        real sums[3];
        for (int kind = 0; kind < 3; ++kind) {
            __global const real *part = diagonal_parts + kind * plane + from;
            sums[kind] = shares[kind] * (part[0] + part[1] + part[line] + part[line + 1]);
            coarse_diagonal_parts[kind * coarse_plane + to] = sums[kind];
        }
        const real diagonal = sums[0] + sums[1] + 0.5f * sums[2];
        coarse_inverse_diagonal[to] = diagonal > 0 ? 1 / diagonal : (real)0;
    }
}
