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
 * One work-item does one pixel; global size (width, height). It reads what linearise.cl writes, and writes the planes of
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
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column >= width || row >= height)
        return;
    const size_t cell = cell_at(column, row, stride), plane = (size_t)stride * (size_t)(height + 2 * PAD);
    const size_t line = (size_t)stride, left = cell - 1, right = cell + 1, up = cell - line, down = cell + line;
    __global const real *own = derivatives, *by_left = own + plane, *by_right = by_left + plane,
                        *by_up = by_right + plane, *by_down = by_up + plane;
    __global const real *along_x = curvature_weights, *along_y = along_x + plane, *across = along_y + plane;
    __global const real *z = log_depth;

    const real x_here = along_x[cell], x_left = along_x[left], x_right = along_x[right];
    const real y_here = along_y[cell], y_up = along_y[up], y_down = along_y[down];
    const real square = across[cell], square_left = across[left], square_up = across[up];
    const real square_up_left = across[up - 1];

    const real of_residuals = own[cell] * own[cell] + by_right[left] * by_right[left] +
                              by_left[right] * by_left[right] + by_down[up] * by_down[up] + by_up[down] * by_up[down];
    const real of_curvature = 4 * (x_here + y_here) + x_left + x_right + y_up + y_down + square + square_left +
                              square_up + square_up_left;
    const real of_prior = prior_terms[cell];
    const real diagonal = (of_residuals + of_curvature + of_prior) * (1 + damping);

    matrix[cell] = diagonal;
    matrix[plane + cell] = own[cell] * by_right[cell] + by_left[right] * own[right] - 2 * (x_here + x_right) -
                           (square + square_up);
    matrix[2 * plane + cell] = by_left[right] * by_right[right] + x_right;
    matrix[3 * plane + cell] = own[cell] * by_down[cell] + by_up[down] * own[down] - 2 * (y_here + y_down) -
                               (square + square_left);
    matrix[4 * plane + cell] = by_up[down] * by_down[down] + y_down;
    matrix[5 * plane + cell] = by_left[right] * by_down[right] + by_up[down] * by_right[down] + square;
    matrix[6 * plane + cell] = by_right[left] * by_down[left] + by_up[down] * by_left[down] + square_left;

    const real bent_here = (z[right] - z[cell]) - (z[cell] - z[left]);
    const real bent_left = (z[cell] - z[left]) - (z[left] - z[left - 1]);
    const real bent_right = (z[right + 1] - z[right]) - (z[right] - z[cell]);
    const real bent_y = (z[down] - z[cell]) - (z[cell] - z[up]);
    const real bent_up = (z[cell] - z[up]) - (z[up] - z[up - line]);
    const real bent_down = (z[down + line] - z[down]) - (z[down] - z[cell]);
    const real twist = (z[down + 1] - z[down]) - (z[right] - z[cell]);
    const real twist_left = (z[down] - z[down - 1]) - (z[cell] - z[left]);
    const real twist_up = (z[right] - z[cell]) - (z[up + 1] - z[up]);
    const real twist_up_left = (z[cell] - z[left]) - (z[up] - z[up - 1]);
    const real gradient = own[cell] * residuals[cell] + by_right[left] * residuals[left] +
                          by_left[right] * residuals[right] + by_down[up] * residuals[up] +
                          by_up[down] * residuals[down] + prior_terms[plane + cell] + x_left * bent_left -
                          2 * x_here * bent_here + x_right * bent_right + y_up * bent_up - 2 * y_here * bent_y +
                          y_down * bent_down + square * twist - square_left * twist_left - square_up * twist_up +
                          square_up_left * twist_up_left;

    int held = fixed[cell] || !(diagonal > 0);
#if BOUNDED
    held = held || (z[cell] <= limits[cell] && gradient > 0) || (z[cell] >= limits[plane + cell] && gradient < 0);
#endif
    remainder[cell] = held ? (real)0 : -gradient;
    inverse_diagonal[cell] = held ? (real)0 : 1 / diagonal;
    diagonal_parts[cell] = held ? (real)0 : of_residuals;
    diagonal_parts[plane + cell] = held ? (real)0 : of_curvature;
    diagonal_parts[2 * plane + cell] = held ? (real)0 : of_prior;
}
