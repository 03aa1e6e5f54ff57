/* The matrix A of a step d of Gauss-Newton's method, A d = -gradient, and the right-hand side.
 *
 * Each residual has to do with a pixel and its four neighbours, each second difference with three pixels in a line or
 * four in a square: A joins a pixel with the twelve that are at most two steps away. It is symmetric, so of each pair one
 * number is kept, in the planes
 *
 *     0 the pixel itself   1 right   2 two to the right   3 below   4 two below   5 right and below   6 left and below
 *
 * The diagonal is raised by a share `damping`. Pixels of known depth, and those that a bound holds, do not move: their
 * part of `inverse_diagonal` is 0, and likewise their right-hand side.
 *
 * Global size (work-items of a row, height). It reads what linearise.cl writes, and writes the planes of
 * A, the right-hand side, 1 over the diagonal, and the parts of the diagonal of residuals, second differences and prior.
 */
__kernel void assemble(__global const real *log_depth,   /* Z, padded                                             */
                       __global const real *derivatives, /* five planes, padded                                   */
                       __global const real *residuals,   /* padded                                                */
                       __global const real *curvature_weights, /* three planes, padded                            */
                       __global const real *prior_terms, /* two planes, padded                                    */
                       __global const uchar *fixed,      /* 1 where the depth is known or there is none, padded    */
                       __global const real *limits,      /* lower and upper bounds, NaN for none; two planes, padded; read
                                                            where BOUNDED is 1                                     */
                       __global real *matrix,            /* seven planes, padded                                  */
                       __global real *remainder,         /* right-hand side, padded                               */
                       __global real *inverse_diagonal,  /* padded                                                */
                       __global real *diagonal_parts,    /* three planes, padded                                  */
                       const real damping,               /* share of the diagonal                                 */
                       const int width,                  /* pixels                                                */
                       const int height,                 /* pixels                                                */
                       const int stride)                 /* of padded rows                                        */
{
    const int row = (int)get_global_id(1);
    const size_t line = (size_t)stride, plane = line * (size_t)(height + 2 * PAD);
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, stride);
        /* The pixel's own derivatives, those of its neighbours, and of the weights of second differences likewise. */
        __global const real *own = derivatives + cell, *by_left = own + plane, *by_right = by_left + plane,
                            *by_up = by_right + plane, *by_down = by_up + plane;
        __global const real *along_x = curvature_weights + cell, *along_y = along_x + plane, *across = along_y + plane;
        __global const real *z = log_depth + cell;

        const number own_here = LOAD(own), own_right = LOAD(own + 1), own_down = LOAD(own + line);
        const number right_here = LOAD(by_right), right_left = LOAD(by_right - 1), right_down = LOAD(by_right + line);
        const number left_right = LOAD(by_left + 1), left_down = LOAD(by_left + line);
        const number down_here = LOAD(by_down), down_up = LOAD(by_down - line), down_left = LOAD(by_down - 1);
        const number down_right = LOAD(by_down + 1), up_down = LOAD(by_up + line);
        const number x_here = LOAD(along_x), x_left = LOAD(along_x - 1), x_right = LOAD(along_x + 1);
        const number y_here = LOAD(along_y), y_up = LOAD(along_y - line), y_down = LOAD(along_y + line);
        const number square = LOAD(across), square_left = LOAD(across - 1), square_up = LOAD(across - line);
        const number square_up_left = LOAD(across - line - 1);

        const number of_residuals = own_here * own_here + right_left * right_left + left_right * left_right +
                                    down_up * down_up + up_down * up_down;
        const number of_curvature = 4 * (x_here + y_here) + x_left + x_right + y_up + y_down + square + square_left +
                                    square_up + square_up_left;
        const number of_prior = LOAD(prior_terms + cell);
        const number diagonal = (of_residuals + of_curvature + of_prior) * (1 + damping);

        __global real *into = matrix + cell;
        STORE(into, diagonal);
        STORE(into + plane,
              own_here * right_here + left_right * own_right - 2 * (x_here + x_right) - (square + square_up));
        STORE(into + 2 * plane, left_right * LOAD(by_right + 1) + x_right);
        STORE(into + 3 * plane,
              own_here * down_here + up_down * own_down - 2 * (y_here + y_down) - (square + square_left));
        STORE(into + 4 * plane, up_down * LOAD(by_down + line) + y_down);
        STORE(into + 5 * plane, left_right * down_right + up_down * right_down + square);
        STORE(into + 6 * plane, right_left * down_left + up_down * left_down + square_left);

        const number here = LOAD(z), left = LOAD(z - 1), right = LOAD(z + 1), up = LOAD(z - line), down = LOAD(z + line);
        const number to_left = here - left, to_right = right - here, to_up = here - up, to_down = down - here;
        const number bent_left = to_left - (left - LOAD(z - 2)), bent_right = (LOAD(z + 2) - right) - to_right;
        const number bent_up = to_up - (up - LOAD(z - 2 * line)), bent_down = (LOAD(z + 2 * line) - down) - to_down;
        const number twist = (LOAD(z + line + 1) - down) - to_right, twist_left = (down - LOAD(z + line - 1)) - to_left;
        const number twist_up = to_right - (LOAD(z - line + 1) - up), twist_up_left = to_left - (up - LOAD(z - line - 1));
        number gradient = own_here * LOAD(residuals + cell) + LOAD(prior_terms + plane + cell);
        gradient += right_left * LOAD(residuals + cell - 1) + left_right * LOAD(residuals + cell + 1);
        gradient += down_up * LOAD(residuals + cell - line) + up_down * LOAD(residuals + cell + line);
        gradient += x_left * bent_left - 2 * x_here * (to_right - to_left) + x_right * bent_right;
        gradient += y_up * bent_up - 2 * y_here * (to_down - to_up) + y_down * bent_down;
        gradient += square * twist - square_left * twist_left - square_up * twist_up + square_up_left * twist_up_left;

        integer free = (GATHER(integer, fixed + cell, 1) == 0) & (diagonal > 0);
#if BOUNDED
        /* Written so that a bound which is NaN holds nothing. */
        const integer on_lower = (here <= LOAD(limits + cell)) & (gradient > 0);
        const integer on_upper = (here >= LOAD(limits + plane + cell)) & (gradient < 0);
        free = free & (on_lower == 0) & (on_upper == 0);
#endif
        STORE(remainder + cell, choose(free, -gradient, 0));
        STORE(inverse_diagonal + cell, choose(free, 1 / diagonal, 0));
        STORE(diagonal_parts + cell, choose(free, of_residuals, 0));
        STORE(diagonal_parts + plane + cell, choose(free, of_curvature, 0));
        STORE(diagonal_parts + 2 * plane + cell, choose(free, of_prior, 0));
    }
}
