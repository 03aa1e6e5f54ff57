/* One Gauss-Seidel step of one cell, in place, by the scheme's inner_value and rim_value.
 *
 * In `brightness` a NaN marks a cell that is not swept: no comparison accepts its candidate. A set sign marks a swept
 * cell on the rim, with a neighbour missing, for schemes that have to know; only there are its flags read.
 */

static inline void update_cell(__global real *log_depth,        /* Z or W = -Z, shape (rows, stride)    */
                               __global const real *brightness, /* marked as above, same shape          */
                               __global const uchar *flags,     /* see prelude, same shape              */
                               const size_t cell, const int stride, const int leftwards, const int upwards,
                               const axis x, const axis y, const real *parameters)
{
    const real shading = brightness[cell];
    if (isnan(shading))
        return;
    const real here = log_depth[cell], left = log_depth[cell - 1], right = log_depth[cell + 1];
    const real up = log_depth[cell - (size_t)stride], down = log_depth[cell + (size_t)stride];
    const real to_p = parameters[SURFACE_SIGN] * parameters[HALF_INVERSE_DX];
    const real to_q = parameters[SURFACE_SIGN] * parameters[HALF_INVERSE_DY];
    real value = inner_value(shading, here, leftwards ? right : left, leftwards ? left : right, upwards ? down : up,
                             upwards ? up : down, leftwards ? -to_p : to_p, upwards ? -to_q : to_q, x, y, parameters);
#if RIM_CELLS
    if (any_sign(as_integer(shading)))
        value = rim_value(magnitude(shading), flags[cell], here, left, right, up, down, x, y, parameters);
#endif
    if (value < here)
        log_depth[cell] = value;
}
