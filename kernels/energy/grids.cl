/* Coarser grids, which hasten the method of conjugate gradients: the remainder is added up on grids of twice, four
 * times, ... the spacing, divided there by about the diagonal that the matrix has there, and interpolated back (additive
 * multilevel preconditioning, Bramble, Pasciak and Xu 1990).
 *
 * A pixel of a coarse grid is a square of four of the finer one. A value is interpolated linearly between the middles of
 * squares, from nine, three and three sixteenths and one sixteenth of four of them; beyond the edge they are 0. Adding up
 * is the transposed of that, so that the whole is symmetric. Each work-item does one pixel of its grid; global size
 * (width, height). All arrays are padded.
 */

/* The value at a pixel of the finer grid. */
static inline real interpolated(__global const real *coarse, const int column, const int row, const int coarse_stride)
{
    const size_t near = cell_at(column / 2, row / 2, coarse_stride);
    const size_t beside = column & 1 ? near + 1 : near - 1, line = (size_t)coarse_stride;
    const size_t near_next = row & 1 ? near + line : near - line, beside_next = row & 1 ? beside + line : beside - line;
    return 0.0625f * (9 * coarse[near] + 3 * (coarse[beside] + coarse[near_next]) + coarse[beside_next]);
}

/* The share of four neighbouring pixels in a row of the finer grid. */
static inline real added_up(__global const real *fine)
{
    return 0.25f * (fine[-1] + fine[2]) + 0.75f * (fine[0] + fine[1]);
}

/* The remainder on the next grid. */
__kernel void restrict_remainder(__global const real *remainder,  /* of the finer grid         */
                                 __global real *coarse_remainder, /* result                    */
                                 const int coarse_width,          /* pixels                    */
                                 const int coarse_height,         /* pixels                    */
                                 const int stride,                /* of the finer grid         */
                                 const int coarse_stride)         /* of the coarse one         */
{
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column >= coarse_width || row >= coarse_height)
        return;
    __global const real *fine = remainder + cell_at(2 * column, 2 * row, stride);
    const size_t line = (size_t)stride;
    coarse_remainder[cell_at(column, row, coarse_stride)] =
        0.25f * (added_up(fine - line) + added_up(fine + 2 * line)) + 0.75f * (added_up(fine) + added_up(fine + line));
}

/* The correction on a grid: the remainder there by about the diagonal, and what comes from the next coarser grid, if
 * there is one.
 */
__kernel void correct_grid(__global const real *remainder,         /* of this grid                         */
                           __global const real *inverse_diagonal,  /* of this grid                         */
                           __global const real *coarse_correction, /* of the next one                      */
                           __global real *correction,              /* result                               */
                           const int has_coarser,                  /* 0 for the last grid                  */
                           const int width,                        /* pixels                               */
                           const int height,                       /* pixels                               */
                           const int stride,                       /* of this grid                         */
                           const int coarse_stride)                /* of the next one                      */
{
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column >= width || row >= height)
        return;
    const size_t cell = cell_at(column, row, stride);
    const real own = inverse_diagonal[cell] * remainder[cell];
    correction[cell] = has_coarser ? own + interpolated(coarse_correction, column, row, coarse_stride) : own;
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
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column >= coarse_width || row >= coarse_height)
        return;
    const size_t from = cell_at(2 * column, 2 * row, stride), line = (size_t)stride;
    const size_t plane = line * (size_t)(height + 2 * PAD);
    const size_t to = cell_at(column, row, coarse_stride);
    const size_t coarse_plane = (size_t)coarse_stride * (size_t)(coarse_height + 2 * PAD);
    const real shares[3] = {0.25f, 0.0625f, 1};
    real sums[3];
    for (int kind = 0; kind < 3; ++kind) {
        __global const real *part = diagonal_parts + kind * plane + from;
        sums[kind] = shares[kind] * (part[0] + part[1] + part[line] + part[line + 1]);
        coarse_diagonal_parts[kind * coarse_plane + to] = sums[kind];
    }
    const real diagonal = sums[0] + sums[1] + 0.5f * sums[2];
    coarse_inverse_diagonal[to] = diagonal > 0 ? 1 / diagonal : (real)0;
}
