/* Steps of the method of conjugate gradients for A d = b, with the matrix of normal_equations.cl; which in what order,
 * and with which numbers, persfs_cl/_cl/energy.py says. Each work-item does one pixel; global size (width rounded up to
 * GROUP, height). All arrays are padded.
 */

/* product = A direction, 0 for what does not move; of each group the sum of product times direction. */
__kernel void multiply(__global const real *matrix,           /* seven planes                       */
                       __global const real *inverse_diagonal, /* 0 for what does not move           */
                       __global const real *direction,        /* 0 there                            */
                       __global real *product,                /* result                             */
                       __global real *partial,                /* a sum of each group                */
                       const int width,                       /* pixels                             */
                       const int height,                      /* pixels                             */
                       const int stride)                      /* of padded rows                     */
{
    __local real shared[GROUP];
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    real share = 0;
    if (column < width) {
        const size_t cell = cell_at(column, row, stride), line = (size_t)stride;
        const size_t plane = line * (size_t)(height + 2 * PAD);
        __global const real *v = direction + cell, *a = matrix + cell;
        real sum = a[0] * v[0];
        a += plane;
        sum += a[0] * v[1] + a[-1] * v[-1];
        a += plane;
        sum += a[0] * v[2] + a[-2] * v[-2];
        a += plane;
        sum += a[0] * v[line] + *(a - line) * *(v - line);
        a += plane;
        sum += a[0] * v[2 * line] + *(a - 2 * line) * *(v - 2 * line);
        a += plane;
        sum += a[0] * v[line + 1] + *(a - line - 1) * *(v - line - 1);
        a += plane;
        sum += a[0] * v[line - 1] + *(a - line + 1) * *(v - line + 1);
        const real result = inverse_diagonal[cell] > 0 ? sum : (real)0;
        product[cell] = result;
        share = result * v[0];
    }
    const real total = sum_of_group(share, shared);
    if (get_local_id(0) == 0)
        partial[get_global_id(1) * get_num_groups(0) + get_group_id(0)] = total;
}

/* The remainder by 1 over the diagonal, and what coarser grids make of it, which `coarse_correction` holds on the next
 * one; of each group the sum of its product with the remainder.
 */
__kernel void precondition(__global const real *remainder,         /* b - A d                            */
                           __global const real *inverse_diagonal,  /* 0 for what does not move           */
                           __global const real *coarse_correction, /* padded array of the next grid      */
                           __global real *correction,              /* result                             */
                           __global real *partial,                 /* a sum of each group                */
                           const int width,                        /* pixels                             */
                           const int stride,                       /* of padded rows                     */
                           const int coarse_stride)                /* of those of the next grid          */
{
    __local real shared[GROUP];
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    real share = 0;
    if (column < width) {
        const size_t cell = cell_at(column, row, stride);
        const real inverse = inverse_diagonal[cell], rest = remainder[cell];
        const real from_coarse = interpolated(coarse_correction, column, row, coarse_stride);
        const real result = inverse > 0 ? multiply_add(inverse, rest, from_coarse) : (real)0;
        correction[cell] = result;
        share = result * rest;
    }
    const real total = sum_of_group(share, shared);
    if (get_local_id(0) == 0)
        partial[get_global_id(1) * get_num_groups(0) + get_group_id(0)] = total;
}

/* direction = correction + turn direction. */
__kernel void turn_direction(__global const real *correction, /* padded           */
                             __global real *direction,        /* changed in place */
                             const real turn,                 /* 0 at first       */
                             const int width,                 /* pixels           */
                             const int stride)                /* of padded rows   */
{
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column >= width)
        return;
    const size_t cell = cell_at(column, row, stride);
    direction[cell] = turn != 0 ? multiply_add(turn, direction[cell], correction[cell]) : correction[cell];
}

/* step += length direction, remainder -= length product. */
__kernel void advance(__global const real *direction, /* padded                              */
                      __global const real *product,   /* padded                              */
                      __global real *step,            /* d, changed in place                 */
                      __global real *remainder,       /* changed in place                    */
                      const real length,              /* along the direction                 */
                      const int first,                /* 1 where d is still to be begun at 0 */
                      const int width,                /* pixels                              */
                      const int stride)               /* of padded rows                      */
{
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column >= width)
        return;
    const size_t cell = cell_at(column, row, stride);
    step[cell] = multiply_add(length, direction[cell], first ? (real)0 : step[cell]);
    remainder[cell] = fnma(length, product[cell], remainder[cell]);
}

/* Z goes by the step, within its bounds; `before` keeps what it was. Of each group the largest change. */
__kernel void move(__global const real *step,   /* padded                                                      */
                   __global const real *limits, /* lower and upper bounds, NaN for none; two planes, padded; read
                                                   where BOUNDED is 1                                          */
                   __global real *log_depth,    /* Z, changed in place                                         */
                   __global real *before,       /* result, padded                                              */
                   __global real *partial,      /* a number of each group                                      */
                   const int width,             /* pixels                                                      */
                   const int height,            /* pixels                                                      */
                   const int stride)            /* of padded rows                                              */
{
    __local real shared[GROUP];
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    real change = 0;
    if (column < width) {
        const size_t cell = cell_at(column, row, stride);
        const real here = log_depth[cell];
        real moved = here + step[cell];
#if BOUNDED
        const size_t plane = (size_t)stride * (size_t)(height + 2 * PAD);
        const real lower = limits[cell], upper = limits[plane + cell];
        moved = lower > moved ? lower : moved;
        moved = upper < moved ? upper : moved;
#endif
        before[cell] = here;
        log_depth[cell] = moved;
        change = magnitude(moved - here);
    }
    const real most_changed = most_of_group(change, shared);
    if (get_local_id(0) == 0)
        partial[get_global_id(1) * get_num_groups(0) + get_group_id(0)] = most_changed;
}
