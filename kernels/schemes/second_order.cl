/* New values of cells by an upwind scheme with differences of second order, once those of first order have converged.
 *
 *     (Z - Z_l) / dx   becomes   (3 Z - 4 Z_l + Z_ll) / (2 dx) = (Z - (4 Z_l - Z_ll) / 3) / (2 dx / 3)
 *
 * where there is a neighbour Z_ll behind Z_l, the characteristic comes from there, (Z_l - Z_ll) / dx >= the middle of
 * {P : H(P) <= 0} along x, and Z is smooth. Elsewhere, at ridges and edges, the difference stays of first order. So the
 * scheme serves unchanged, with other neighbours and other spacings. The value is taken even where it lies above the
 * present one: this correction is not monotone. Pixels that look smooth in one iteration and not in the next may keep
 * it going for ever. With ONLY_LOWER values only fall, as in all other sweeps, and it ends.
 *
 * For the lanes of one vector; it reads no memory of the device.
 */
typedef struct {
    number value;  /* corrected where that is possible                          */
    number nearer; /* spacing over corrected spacing: 1.5, or 1 where it is not */
} neighbour;

#define SMOOTH 0.6f /* largest |second difference| over the sum of both |first ones|; a parabola's is at most a half */

/* `rise` is the middle of the sublevel set times the spacing, so that differences are seen from there. */
static inline neighbour corrected(const number here, const number near, const number next, const number rise)
{
    const number step = here - near - rise, step_before = near - next - rise;
    const integer smooth = magnitude(step - step_before) <= SMOOTH * (magnitude(step) + magnitude(step_before));
    const integer there = most(near, next) < 0.5f * NOWHERE;
    const integer possible = smooth & there & (step_before >= 0);
    const number extrapolated = multiply_add(near - next, (real)1 / 3, near);
    const neighbour result = {possible ? extrapolated : near, choose(possible, 1.5f, 1)};
    return result;
}

/* Of each side the neighbour and the next one, by names as in first_order.cl. */
static inline number value_of(const number brightness, const number here, const number *left, const number *right,
                              const number *up, const number *down, const real to_p, const real to_q, const axis x,
                              const axis y, const parameter_set *parameters)
{
    const real dx = 1 / (2 * to_p), dy = 1 / (2 * to_q);
    const number rise_x = dx * middle_gradient(brightness, here, x.coordinate, y.coordinate, 0, parameters);
    const number rise_y = dy * middle_gradient(brightness, here, x.coordinate, y.coordinate, 1, parameters);
    /* The quadrant that the characteristic comes from, by the outward normal of the sublevel set at central
     * differences. A missing neighbour is very high, so that the other is taken for the upwind one.
     */
    const slopes normal = outward_normal(brightness, here, (right[0] - left[0]) * to_p, (down[0] - up[0]) * to_q,
                                         x.coordinate, y.coordinate, parameters);
    number turn_x = choose(to_p * normal.p < 0, -1, 1);
    number turn_y = choose(to_q * normal.q < 0, -1, 1);
    /* Where the surface is smooth that quadrant suffices: between two quadrants both give the same. Elsewhere the least
     * of all four counts. A lane that is decided stays, so that its bits do not depend on others.
     */
    number value = NOWHERE, undecided = choose(brightness == brightness, -1, 1);
    __attribute__((opencl_unroll_hint(1))) for (int tried = 0; tried < 4 && any_sign(as_integer(undecided)); ++tried) {
        const neighbour across = corrected(here, turn_x < 0 ? right[0] : left[0],
                                           turn_x < 0 ? right[1] : left[1], turn_x * rise_x);
        const neighbour along = corrected(here, turn_y < 0 ? down[0] : up[0],
                                          turn_y < 0 ? down[1] : up[1], turn_y * rise_y);
        const number candidate =
            inner_value(brightness, here, across.value, NOWHERE, along.value, NOWHERE, turn_x * to_p * across.nearer,
                        turn_y * to_q * along.nearer, x, y, parameters);
        value = undecided < 0 ? least(candidate, value) : value;
        if (tried == 0)
            undecided = choose(least(across.nearer, along.nearer) > 1, 1, undecided);
        /* To the next quadrant around the cell. */
        turn_x = tried == 1 ? turn_x : -turn_x;
        turn_y = tried == 1 ? -turn_y : turn_y;
    }
    return value;
}
