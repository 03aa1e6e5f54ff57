/* The forward model, eq. (6) for any light: E = rendered(Z, p, q, x, y), of which the model gives the right-hand side.
 *
 * The slopes p = dZ/dx and q = dZ/dy are central differences, one-sided where a neighbour is missing, and 0 where both
 * are. One work-item renders one pixel: global size (width, height). It reads Z there and at the four neighbours, and
 * writes the brightness; NaN where the flag SWEPT is not set, since the pixel has no depth.
 */
static inline real slope(const real before, const real here, const real after, const int no_before, const int no_after,
                         const real half_inverse_spacing)
{
    if (no_before && no_after)
        return (real)0;
    const real scale = no_before || no_after ? 2 * half_inverse_spacing : half_inverse_spacing;
    return ((no_after ? here : after) - (no_before ? here : before)) * scale;
}

__kernel void render(__global const real *log_depth,  /* Z, shape (height, width)                     */
                     __global const uchar *flags,     /* see prelude, shape (height, width)           */
                     __global const parameter_set *parameters, /* of the image                                 */
                     __global const real *columns,    /* x, shape (width,)                            */
                     __global const real *lines,      /* y, shape (height,)                           */
                     __global real *brightness,       /* result, shape (height, width)                */
                     const int width,                 /* pixels                                       */
                     const int height)                /* pixels                                       */
{
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column >= width || row >= height)
        return;
    const size_t cell = (size_t)row * (size_t)width + (size_t)column;
    const int flag = flags[cell];
    if (!(flag & SWEPT)) {
        brightness[cell] = (real)NAN;
        return;
    }
    const parameter_set numbers = parameters[0];
    const real here = log_depth[cell];
    const real p = slope(log_depth[flag & NO_LEFT ? cell : cell - 1], here,
                         log_depth[flag & NO_RIGHT ? cell : cell + 1], flag & NO_LEFT, flag & NO_RIGHT,
                         numbers.half_inverse_dx);
    const real q = slope(log_depth[flag & NO_UP ? cell : cell - (size_t)width], here,
                         log_depth[flag & NO_DOWN ? cell : cell + (size_t)width], flag & NO_UP, flag & NO_DOWN,
                         numbers.half_inverse_dy);
    const real x = columns[column], y = lines[row];
    brightness[cell] = rendered(here, p, q, x, y, &numbers);
}
