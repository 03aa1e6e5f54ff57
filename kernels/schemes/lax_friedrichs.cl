/* New values of cells by the Lax-Friedrichs scheme, eq. (11) with its sign put right, for a Hamiltonian
 *
 *     H(Z, P) = (dH/dZ) Z + C N(P) - M(P),    C = coefficient_of_norm,  N = norm_part,  M = regular_part
 *
 * of which the model gives the parts; C depends on the brightness alone. DH_DZ is 0 where H does not depend on Z, as in
 * the paper.
 *
 *     Z = [ M - C N + sigma_x (Z_r + Z_l) / (2 dx) + sigma_y (Z_d + Z_u) / (2 dy) ]
 *         / (sigma_x / dx + sigma_y / dy + dH/dZ)
 *
 * at central differences P. As sigma_x and sigma_y are bounds of |dH/dp| and |dH/dq|, Z does not fall where a neighbour
 * rises: the scheme is monotone. Their terms of column and row come from tables, which saves square roots and
 * divisions.
 *
 * The order of the operations keeps the chain from Z_l and Z_u to the result short, since in a sweep every cell waits
 * for these two: N is the last to be known.
 *
 * Functions for the lanes of one vector; they read no memory.
 */
#define RIM_CELLS 1 /* cells of the rim, with a neighbour missing, are marked, and have rim_value */
#define DIRECTED 0  /* a cell has all its neighbours, whatever the direction of the sweep */

/* Eq. (11). */

static inline number candidate(const number brightness,
                               const number p,     /* dZ/dx, also where W is solved for */
                               const number q,     /* dZ/dy                             */
                               const number sum_x, /* Z_r + Z_l, or of W                */
                               const number sum_y, /* Z_d + Z_u                         */
                               const axis x, const axis y, const parameter_set *parameters)
{
    const number weight_x = viscosity(brightness, x, y, parameters);
    const number weight_y = viscosity(brightness, y, x, parameters);
    const number scale = 1 / (2 * (weight_x + weight_y) + DH_DZ);
    const number even = multiply_add(
        weight_x, sum_x,
        multiply_add(weight_y, sum_y, regular_part(brightness, p, q, x.coordinate, y.coordinate, parameters)));
    const number norm = norm_part(p, q, x.coordinate, y.coordinate, parameters);
    return fnma(coefficient_of_norm(brightness) * scale, norm, even * scale);
}

/* The bound, no cell more than one step above a neighbour, limits the values where the Hamiltonian does not, since the
 * pixel is so dark that {P : H(P) <= 0} is unbounded. Elsewhere it changes nothing.
 *
 * `to_p` and `to_q` turn differences into dZ/dx and dZ/dy: 1 / (2 dx) and 1 / (2 dy), with the sign of the surface.
 * Left and right may change places if `to_p` changes its sign, and so may up and down: the bits are the same.
 */
static inline number inner_value(const number brightness, const number here, const number left, const number right,
                                 const number up, const number down, const real to_p, const real to_q, const axis x,
                                 const axis y, const parameter_set *parameters)
{
    const number value = candidate(brightness, (right - left) * to_p, (down - up) * to_q, right + left, down + up, x, y,
                                   parameters);
    const number highest = least(least(left, right) + parameters->step_x, least(up, down) + parameters->step_y);
    return highest < value ? highest : value;
}

/* The gradient along one axis where a neighbour is missing: a state constraint, nothing flows in from outside.
 *
 * The difference is one-sided, and stops at p* = argmin H, so that H does not rise with the inner neighbour: that keeps
 * the scheme monotone. Where both neighbours are missing it is p* itself.
 */
static inline number constrained(const number here, const number before, const number after, const integer no_before,
                                 const integer no_after, const real half_inverse_spacing, const number argmin)
{
    const real inverse_spacing = 2 * half_inverse_spacing;
    const number from_after = least((after - here) * inverse_spacing, argmin);
    const number from_before = most((here - before) * inverse_spacing, argmin);
    const number one_sided = no_before != 0 ? from_after : from_before;
    const number outer = (no_before & no_after) != 0 ? argmin : one_sided;
    return (no_before | no_after) != 0 ? outer : (after - before) * half_inverse_spacing;
}

/* As inner_value, where `flags` may say that neighbours are missing; the values of these do not matter. */
static inline number rim_value(const number brightness, const integer flags, const number here, const number left,
                               const number right, const number up, const number down, const axis x, const axis y,
                               const parameter_set *parameters)
{
    /* All bits set or none, as in a condition on vectors. */
    const integer no_left = -((flags / NO_LEFT) & 1), no_right = -((flags / NO_RIGHT) & 1);
    const integer no_up = -((flags / NO_UP) & 1), no_down = -((flags / NO_DOWN) & 1);
    const number central = (right - left) * parameters->half_inverse_dx;
    number gradient_x = choose((no_left | no_right) != 0, 0, central);
    number gradient_y = 0;
    /* In a corner p* and q* depend on each other: some turns of coordinate descent on a convex function. */
    for (int turn = 0; turn < 3; ++turn) {
        gradient_y = constrained(here, up, down, no_up, no_down, parameters->half_inverse_dy,
                                 argmin_gradient(brightness, gradient_x, y.coordinate, x.coordinate, 1, parameters));
        gradient_x = constrained(here, left, right, no_left, no_right, parameters->half_inverse_dx,
                                 argmin_gradient(brightness, gradient_y, x.coordinate, y.coordinate, 0, parameters));
    }
    const number sum_x = (no_left | no_right) != 0 ? here + here : right + left;
    const number sum_y = (no_up | no_down) != 0 ? here + here : down + up;
    const real sign = parameters->sign;
    const number value = candidate(brightness, sign * gradient_x, sign * gradient_y, sum_x, sum_y, x, y, parameters);
    const number none = INFINITY;
    const number lowest_x = least(no_left != 0 ? none : left, no_right != 0 ? none : right);
    const number lowest_y = least(no_up != 0 ? none : up, no_down != 0 ? none : down);
    const number highest = least(lowest_x + parameters->step_x, lowest_y + parameters->step_y);
    return highest < value ? highest : value;
}
