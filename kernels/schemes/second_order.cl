/* New values of cells with differences of second order, once those of first order have converged.
 *
 *     (Z - Z_l) / dx   becomes   (3 Z - 4 Z_l + Z_ll) / (2 dx) = (Z - (4 Z_l - Z_ll) / 3) / (2 dx / 3)
 *
 * where there is a next neighbour behind the neighbour and the information comes from there: where the gradient between
 * the two lies on that side of the middle of the gradients that the pixel allows. Elsewhere, beside ridges and edges, the
 * difference stays of first order. So the upwind scheme serves unchanged, with other neighbours and other spacings. The
 * value is taken even where it lies above the present one: this correction is not monotone. Pixels that look smooth in
 * one iteration and not in the next may keep it going for ever. With ONLY_LOWER values only fall, as in all other sweeps,
 * and it ends.
 */
typedef struct {
    number value;  /* corrected where that is possible                          */
    number nearer; /* spacing over corrected spacing: 1.5, or 1 where it is not */
} neighbour;

#define SMOOTH ((number)0.6f) /* largest share of the second difference in the first ones; a parabola's is at most a half */

static inline neighbour corrected(const number here, const number near, const number next, const number rise)
{
    const number step = here - near - rise, step_before = near - next - rise;
    const integer smooth = magnitude(step - step_before) <= SMOOTH * (magnitude(step) + magnitude(step_before));
    const integer there = most(near, next) < (number)(0.5f * NOWHERE);
    const integer possible = smooth & there & (step_before >= (number)0);
    const number extrapolated = multiply_add(near - next, (real)1 / 3, near);
    const neighbour result = {possible ? extrapolated : near, possible ? (number)1.5f : (number)1};
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
    /* Which quadrant the information comes from the normal of the level set tells, at central differences. A missing
     * neighbour is very high, so that the other is taken for the one upwind.
     */
    const slopes normal = outward_normal(brightness, here, (right[0] - left[0]) * to_p, (down[0] - up[0]) * to_q,
                                         x.coordinate, y.coordinate, parameters);
    number turn_x = to_p * normal.p < (number)0 ? (number)-1 : (number)1;
    number turn_y = to_q * normal.q < (number)0 ? (number)-1 : (number)1;
    /* Where the surface is smooth that one suffices: between two quadrants both give the same. Elsewhere all compete. A
     * lane that is decided stays, so that its bits do not depend on others.
     */
    number value = NOWHERE, undecided = brightness >= (number)0 ? (number)-1 : (number)1;
    __attribute__((opencl_unroll_hint(1))) for (int tried = 0; tried < 4 && any_sign(as_integer(undecided)); ++tried) {
        const neighbour across = corrected(here, turn_x < (number)0 ? right[0] : left[0],
                                           turn_x < (number)0 ? right[1] : left[1], turn_x * rise_x);
        const neighbour along = corrected(here, turn_y < (number)0 ? down[0] : up[0],
                                          turn_y < (number)0 ? down[1] : up[1], turn_y * rise_y);
        const number candidate =
            inner_value(brightness, here, across.value, (number)NOWHERE, along.value, (number)NOWHERE,
                        turn_x * to_p * across.nearer, turn_y * to_q * along.nearer, x, y, parameters);
        value = undecided < (number)0 ? least(candidate, value) : value;
        if (tried == 0)
            undecided = least(across.nearer, along.nearer) > (number)1 ? (number)1 : undecided;
        /* To the quadrant beside this one. */
        turn_x = tried == 1 ? turn_x : -turn_x;
        turn_y = tried == 1 ? -turn_y : turn_y;
    }
    return value;
}
