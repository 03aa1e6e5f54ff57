/* One Gauss-Seidel step of one cell: fetch the neighbours, ask the scheme for a candidate, keep it if it is smaller.
 *
 * No cell may lie more than one step above a neighbour. That bounds the values where the Hamiltonian does not (the
 * pixel is so dark that {P : H(P) <= 0} is unbounded) and costs a regular cell nothing.
 */

/* Gradient along one axis where a neighbour is missing: a state constraint, nothing flows in from outside.
 *
 * The difference is one-sided, and stops at the slope where H is least, so that H never rises with the inner neighbour:
 * that keeps the scheme monotone. Where both neighbours are missing the least slope itself is taken.
 */
static inline real constrained(const real here, const real before, const real after, const uint no_before,
                               const uint no_after, const real inverse_spacing, const real least)
{
    if (no_before && no_after)
        return least;
    if (no_before)
        return fmin((after - here) * inverse_spacing, least);
    if (no_after)
        return fmax((here - before) * inverse_spacing, least);
    return (after - before) * ((real)0.5 * inverse_spacing);
}

static inline real rim_value(const real brightness, const uint flag, const real here, const real left,
                             const real right, const real up, const real down, const real x, const real y,
                             __constant const real *parameters)
{
    const real inverse_dx = (real)2 * parameters[HALF_INVERSE_DX];
    const real inverse_dy = (real)2 * parameters[HALF_INVERSE_DY];
    const real steepest = parameters[STEP_X] * inverse_dx;
    real gradient_x = 0, gradient_y = 0;
    if (!(flag & (NO_LEFT | NO_RIGHT)))
        gradient_x = (right - left) * parameters[HALF_INVERSE_DX];
    /* In a corner the two slopes depend on each other: a few turns of coordinate descent on a convex function. */
    const int turns = flag & (NO_LEFT | NO_RIGHT) && flag & (NO_UP | NO_DOWN) ? 3 : 1;
    for (int turn = 0; turn < turns; ++turn) {
        gradient_y = constrained(here, up, down, flag & NO_UP, flag & NO_DOWN, inverse_dy,
                                 least_gradient_y(brightness, gradient_x, x, y, steepest, parameters));
        gradient_x = constrained(here, left, right, flag & NO_LEFT, flag & NO_RIGHT, inverse_dx,
                                 least_gradient_x(brightness, gradient_y, x, y, steepest, parameters));
    }
    const real none = (real)INFINITY;
    const real lowest_x = fmin(flag & NO_LEFT ? none : left, flag & NO_RIGHT ? none : right);
    const real lowest_y = fmin(flag & NO_UP ? none : up, flag & NO_DOWN ? none : down);
    const real highest = fmin(lowest_x + parameters[STEP_X], lowest_y + parameters[STEP_Y]);
    const real sum_x = flag & (NO_LEFT | NO_RIGHT) ? (real)2 * here : left + right;
    const real sum_y = flag & (NO_UP | NO_DOWN) ? (real)2 * here : up + down;
    return fmin(candidate(brightness, gradient_x, gradient_y, sum_x, sum_y, x, y, parameters), highest);
}

static inline real inner_value(const real brightness, const real left, const real right, const real up,
                               const real down, const real x, const real y, __constant const real *parameters)
{
    const real highest = fmin(fmin(left, right) + parameters[STEP_X], fmin(up, down) + parameters[STEP_Y]);
    return fmin(candidate(brightness, (right - left) * parameters[HALF_INVERSE_DX],
                          (down - up) * parameters[HALF_INVERSE_DY], left + right, up + down, x, y, parameters),
                highest);
}

static inline void update_cell(__global real *log_depth,        /* Z or W = -Z, shape (height, width), in place */
                               __global const real *brightness, /* E in [0, 1], shape (height, width)           */
                               __global const uchar *flags,     /* see prelude, shape (height, width)           */
                               __constant const real *parameters, const int width, const int column, const int row)
{
    const size_t cell = (size_t)row * (size_t)width + (size_t)column;
    const uint flag = flags[cell];
    if (!(flag & SWEPT))
        return;

    const real here = log_depth[cell];
    /* The cell stands in for a missing neighbour, so that nothing outside the array is read. */
    const real left = log_depth[flag & NO_LEFT ? cell : cell - 1];
    const real right = log_depth[flag & NO_RIGHT ? cell : cell + 1];
    const real up = log_depth[flag & NO_UP ? cell : cell - (size_t)width];
    const real down = log_depth[flag & NO_DOWN ? cell : cell + (size_t)width];
    const real x = multiply_add((real)column, parameters[GRID_DX], parameters[GRID_X0]);
    const real y = multiply_add((real)row, parameters[GRID_DY], parameters[GRID_Y0]);
    const real value = flag & MISSING
                           ? rim_value(brightness[cell], flag, here, left, right, up, down, x, y, parameters)
                           : inner_value(brightness[cell], left, right, up, down, x, y, parameters);
    if (value < here)
        log_depth[cell] = value;
}
