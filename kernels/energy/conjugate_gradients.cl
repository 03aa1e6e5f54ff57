/* Steps of the method of conjugate gradients for A d = b, with the matrix of normal_equations.cl; which in what order,
 * and with which numbers, persfs_cl/_cl/energy.py says. Global size (work-items of a row, height). All arrays are padded.
 */

/* product = A direction, 0 for what does not move; of each work-item the sum of product times direction. */
__kernel void multiply(__global const real *matrix,           /* seven planes                       */
                       __global const real *inverse_diagonal, /* 0 for what does not move           */
                       __global const real *direction,        /* 0 there                            */
                       __global real *product,                /* result                             */
                       __global real *partial,                /* a sum of each work-item             */
                       const int width,                       /* pixels                             */
                       const int height,                      /* pixels                             */
                       const int stride)                      /* of padded rows                     */
{
    const int row = (int)get_global_id(1);
    const size_t line = (size_t)stride, plane = line * (size_t)(height + 2 * PAD);
    number total = 0;
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, stride);
        __global const real *v = direction + cell, *a = matrix + cell;
        const number here = LOAD(v);
        number sum = LOAD(a) * here;
        a += plane;
        sum = multiply_add(LOAD(a), LOAD(v + 1), multiply_add(LOAD(a - 1), LOAD(v - 1), sum));
        a += plane;
        sum = multiply_add(LOAD(a), LOAD(v + 2), multiply_add(LOAD(a - 2), LOAD(v - 2), sum));
        a += plane;
        sum = multiply_add(LOAD(a), LOAD(v + line), multiply_add(LOAD(a - line), LOAD(v - line), sum));
        a += plane;
        sum = multiply_add(LOAD(a), LOAD(v + 2 * line), multiply_add(LOAD(a - 2 * line), LOAD(v - 2 * line), sum));
        a += plane;
        sum = multiply_add(LOAD(a), LOAD(v + line + 1), multiply_add(LOAD(a - line - 1), LOAD(v - line - 1), sum));
        a += plane;
        sum = multiply_add(LOAD(a), LOAD(v + line - 1), multiply_add(LOAD(a - line + 1), LOAD(v - line + 1), sum));
        const number result = choose(LOAD(inverse_diagonal + cell) > 0, sum, 0);
        STORE(product + cell, result);
        total = multiply_add(result, here, total);
    }
    partial[place_of_item()] = sum_of_lanes(total);
}

/* The remainder by 1 over the diagonal, and what coarser grids make of it, which `coarse_correction` holds on the next
 * one; of each work-item the sum of its product with the remainder.
 */
__kernel void precondition(__global const real *remainder,         /* b - A d                            */
                           __global const real *inverse_diagonal,  /* 0 for what does not move           */
                           __global const real *coarse_correction, /* padded array of the next grid      */
                           __global real *correction,              /* result                             */
                           __global real *partial,                 /* a sum of each work-item             */
                           const int width,                        /* pixels                             */
                           const int stride,                       /* of padded rows                     */
                           const int coarse_stride)                /* of those of the next grid          */
{
    const int row = (int)get_global_id(1);
    number total = 0;
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, stride);
        const number inverse = LOAD(inverse_diagonal + cell), rest = LOAD(remainder + cell);
        const number from_coarse = interpolated(coarse_correction, column, row, coarse_stride);
        const number result = choose(inverse > 0, multiply_add(inverse, rest, from_coarse), 0);
        STORE(correction + cell, result);
        total = multiply_add(result, rest, total);
    }
    partial[place_of_item()] = sum_of_lanes(total);
}

/* direction = correction + turn direction. */
__kernel void turn_direction(__global const real *correction, /* padded           */
                             __global real *direction,        /* changed in place */
                             const real turn,                 /* 0 at first       */
                             const int width,                 /* pixels           */
                             const int stride)                /* of padded rows   */
{
    const int row = (int)get_global_id(1);
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, stride);
        const number next = LOAD(correction + cell);
        STORE(direction + cell, turn != 0 ? multiply_add(turn, LOAD(direction + cell), next) : next);
    }
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
    const int row = (int)get_global_id(1);
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, stride);
        const number part = length * LOAD(direction + cell);
        STORE(step + cell, first ? part : LOAD(step + cell) + part);
        STORE(remainder + cell, fnma(length, LOAD(product + cell), LOAD(remainder + cell)));
    }
}

/* How a step goes with the last one: of each work-item the sums of step times the right-hand side before, and of the direction
 * that was gone along times the right-hand side now.
 */
__kernel void compare_steps(__global const real *step,           /* d, padded                           */
                            __global const real *last_direction, /* padded                              */
                            __global const real *right_hand_side, /* b, padded                          */
                            __global const real *last_right_hand_side, /* of the step before, padded    */
                            __global real *partial,              /* two sums of each work-item          */
                            const int width,                     /* pixels                              */
                            const int stride)                    /* of padded rows                      */
{
    const int row = (int)get_global_id(1);
    number with_last = 0, along_last = 0;
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, stride);
        with_last = multiply_add(LOAD(step + cell), LOAD(last_right_hand_side + cell), with_last);
        along_last = multiply_add(LOAD(last_direction + cell), LOAD(right_hand_side + cell), along_last);
    }
    __global real *sums = partial + 2 * place_of_item();
    sums[0] = sum_of_lanes(with_last);
    sums[1] = sum_of_lanes(along_last);
}

/* Z goes in a direction, within its bounds; `before` keeps what it was. Of each work-item the largest change. */
__kernel void move(__global const real *direction, /* padded                                                   */
                   __global const real *limits, /* lower and upper bounds, NaN for none; two planes, padded; read
                                                   where BOUNDED is 1                                          */
                   __global real *log_depth,    /* Z, changed in place                                         */
                   __global real *before,       /* result, padded                                              */
                   __global real *partial,      /* a number of each work-item                                   */
                   const real length,           /* so many times                                               */
                   const int width,             /* pixels                                                      */
                   const int height,            /* pixels                                                      */
                   const int stride)            /* of padded rows                                              */
{
    const int row = (int)get_global_id(1);
    number most_changed = 0;
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, stride);
        const number here = LOAD(log_depth + cell);
        number moved = multiply_add(length, LOAD(direction + cell), here);
#if BOUNDED
        const size_t plane = (size_t)stride * (size_t)(height + 2 * PAD);
        const number lower = LOAD(limits + cell), upper = LOAD(limits + plane + cell);
        moved = lower > moved ? lower : moved;
        moved = upper < moved ? upper : moved;
#endif
        STORE(before + cell, here);
        STORE(log_depth + cell, moved);
        most_changed = most(most_changed, magnitude(moved - here));
    }
    partial[place_of_item()] = most_of_lanes(most_changed);
}
