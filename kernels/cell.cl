/* New values of cells from their neighbours: the scheme's candidate, bounded by the steepest slope.
 *
 * The bound, no cell more than one step above a neighbour, holds the values where the Hamiltonian does not (the pixel
 * is so dark that {P : H(P) <= 0} is unbounded) and costs a regular cell nothing.
 *
 * In `brightness` a NaN marks a cell that is not swept: no comparison accepts its candidate. A set sign marks a swept
 * cell on the rim, with a neighbour missing; only there are its flags read.
 */
/* `to_p` and `to_q` turn differences into dZ/dx and dZ/dy: 1 / (2 dx), with the sign of the surface. Left and right may
 * change places, and so may up and down, if these change their sign: the bits are the same.
 */
static inline number inner_value(const number brightness, const number left, const number right, const number up,
                                 const number down, const real to_p, const real to_q, const axis x, const axis y,
                                 const real *parameters)
{
    const number value = candidate(brightness, (right - left) * to_p, (down - up) * to_q, right + left, down + up,
                                   x, y, parameters);
    const number highest = least(least(left, right) + parameters[STEP_X], least(up, down) + parameters[STEP_Y]);
    return highest < value ? highest : value;
}

/* Gradient along one axis where a neighbour is missing: a state constraint, nothing flows in from outside.
 *
 * The difference is one-sided, and stops at the slope where H is least, so that H never rises with the inner neighbour:
 * that keeps the scheme monotone. Where both neighbours are missing the least slope itself is taken.
 */
static inline number constrained(const number here, const number before, const number after, const integer no_before,
                                 const integer no_after, const real half_inverse_spacing, const number least_slope)
{
    const real inverse_spacing = 2 * half_inverse_spacing;
    const number from_after = least((after - here) * inverse_spacing, least_slope);
    const number from_before = most((here - before) * inverse_spacing, least_slope);
    const number one_sided = no_before != 0 ? from_after : from_before;
    const number outer = (no_before & no_after) != 0 ? least_slope : one_sided;
    return (no_before | no_after) != 0 ? outer : (after - before) * half_inverse_spacing;
}

/* As inner_value, where `flags` may say that neighbours are missing; their values are of no consequence. */
static inline number rim_value(const number brightness, const integer flags, const number here, const number left,
                               const number right, const number up, const number down, const axis x, const axis y,
                               const real *parameters)
{
    /* All bits set or none, as a condition on vectors wants them. */
    const integer no_left = -((flags / NO_LEFT) & 1), no_right = -((flags / NO_RIGHT) & 1);
    const integer no_up = -((flags / NO_UP) & 1), no_down = -((flags / NO_DOWN) & 1);
    const number central = (right - left) * parameters[HALF_INVERSE_DX];
    number gradient_x = (no_left | no_right) != 0 ? (number)0 : central;
    number gradient_y = (number)0;
    /* In a corner the two slopes depend on each other: a few turns of coordinate descent on a convex function. */
    for (int turn = 0; turn < 3; ++turn) {
        gradient_y = constrained(here, up, down, no_up, no_down, parameters[HALF_INVERSE_DY],
                                 least_gradient(brightness, gradient_x, y.coordinate, x.coordinate,
                                                parameters[LIGHT_Q0], parameters));
        gradient_x = constrained(here, left, right, no_left, no_right, parameters[HALF_INVERSE_DX],
                                 least_gradient(brightness, gradient_y, x.coordinate, y.coordinate,
                                                parameters[LIGHT_P0], parameters));
    }
    const number sum_x = (no_left | no_right) != 0 ? here + here : right + left;
    const number sum_y = (no_up | no_down) != 0 ? here + here : down + up;
    const real sign = parameters[SURFACE_SIGN];
    const number value = candidate(brightness, sign * gradient_x, sign * gradient_y, sum_x, sum_y, x, y, parameters);
    const number none = (number)INFINITY;
    const number lowest_x = least(no_left != 0 ? none : left, no_right != 0 ? none : right);
    const number lowest_y = least(no_up != 0 ? none : up, no_down != 0 ? none : down);
    const number highest = least(lowest_x + parameters[STEP_X], lowest_y + parameters[STEP_Y]);
    return highest < value ? highest : value;
}

#if LANES == 1
/* Table of one axis: coordinate, root and offset, each of `length` numbers. */
static inline axis axis_at(__global const real *table, const int length, const int index)
{
    const axis result = {table[index], table[length + index], table[2 * length + index]};
    return result;
}

/* One Gauss-Seidel step of one cell, in place. */
static inline void update_cell(__global real *log_depth,        /* Z or W = -Z, shape (rows, stride) */
                               __global const real *brightness, /* E, marked as above, same shape    */
                               __global const uchar *flags,     /* see prelude, same shape           */
                               const size_t cell, const size_t left, const size_t right, const size_t up,
                               const size_t down, const axis x, const axis y, const real *parameters)
{
    const real shading = brightness[cell];
    if (isnan(shading))
        return;
    const real here = log_depth[cell];
    const real value =
        any_sign(as_integer(shading))
            ? rim_value(magnitude(shading), flags[cell], here, log_depth[left], log_depth[right], log_depth[up],
                        log_depth[down], x, y, parameters)
            : inner_value(shading, log_depth[left], log_depth[right], log_depth[up], log_depth[down],
                          parameters[SURFACE_SIGN] * parameters[HALF_INVERSE_DX],
                          parameters[SURFACE_SIGN] * parameters[HALF_INVERSE_DY], x, y, parameters);
    if (value < here)
        log_depth[cell] = value;
}
#endif
