/* One Gauss-Seidel step of one cell, in place: its value by value_of of first_order.cl or second_order.cl, accepted by
 * update.cl. The variant for one cell a work-item at a time: LANES is 1.
 *
 * Reads the cell, REACH neighbours on every side and, at the rim, its flags; writes the cell where it accepts a value.
 * Returns its change.
 */
static inline real update_cell(__global real *log_depth,        /* Z or W = -Z, shape (rows, stride)   */
                               __global const real *brightness, /* marked as in update.cl, same shape */
                               const bounds within,             /* see prelude.cl, same shape          */
                               __global const uchar *flags,     /* see prelude.cl, same shape          */
                               const size_t cell, const int stride, const int leftwards, const int upwards,
                               const axis x, const axis y, const parameter_set *parameters)
{
    const real shading = brightness[cell];
    if (isnan(shading))
        return 0;
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
    const real value = value_of(shading, here, left, right, up, down, to_p, to_q, x, y, parameters);
    number limits[LIMITS + 1];
    for (int k = 0; k < LIMITS; ++k)
        limits[k] = (k == 0 ? within.lower : within.upper)[cell];
    const real result = updated(value, shading, here, at[-1], at[1], at[-(long)stride], at[stride], limits,
                                flags + cell, 1, x, y, parameters, 1);
    /* Else it is what stands there. */
    if (!(result < bound_of(here)))
        return 0;
    log_depth[cell] = result;
    return magnitude(here - result);
}
