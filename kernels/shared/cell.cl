/* One Gauss-Seidel step of one cell, in place, by value_of, from first_order.cl or second_order.cl, and by the scheme's
 * rim_value.
 *
 * In `brightness` a NaN marks a cell that is not swept: no comparison accepts its candidate. A set sign marks a swept
 * cell on the rim, with a neighbour missing, for schemes that have to know; only there are its flags read.
 */

static inline void update_cell(__global real *log_depth,        /* Z or W = -Z, shape (rows, stride)    */
                               __global const real *brightness, /* marked as above, same shape          */
                               __global const uchar *flags,     /* see prelude, same shape              */
                               const size_t cell, const int stride, const int leftwards, const int upwards,
                               const axis x, const axis y, const parameter_set *parameters)
{
    const real shading = brightness[cell];
    if (isnan(shading))
        return;
    const real to_p = parameters->sign * parameters->half_inverse_dx * (leftwards ? -1 : 1);
    const real to_q = parameters->sign * parameters->half_inverse_dy * (upwards ? -1 : 1);
    const long column_step = leftwards ? -1 : 1, row_step = upwards ? -(long)stride : (long)stride;
    __global const real *at = log_depth + cell;
    const real here = *at;
    real left[REACH], right[REACH], up[REACH], down[REACH];
    for (int k = 0; k < REACH; ++k) {
        left[k] = at[-(k + 1) * column_step];
        right[k] = at[(k + 1) * column_step];
        up[k] = at[-(k + 1) * row_step];
        down[k] = at[(k + 1) * row_step];
    }
    real value = value_of(shading, here, left, right, up, down, to_p, to_q, x, y, parameters);
#if RIM_CELLS
    if (any_sign(as_integer(shading)))
        value = rim_value(magnitude(shading), flags[cell], here, at[-1], at[1], at[-(long)stride], at[stride],
                          x, y, parameters);
#endif
    if (value < bound_of(here))
        log_depth[cell] = value;
}
