/* New values of cells by the upwind scheme, for a lamp beside the camera. As in upwind_flash.cl two curves meet,
 *
 *     Z = U(t)    the least climb from the neighbours, climb.cl, at steepness t towards the lamp: rises with t
 *     Z = D(t)    at which the surface has the brightness seen: falls with t
 *
 * and the true value lies between both, whatever t, but for a small margin: Z comes down to its limit from above. U has no
 * simple form, since the direction to the lamp is another at each depth, so that the t where they meet is found by
 * secants; the first step goes by the slopes that a lamp at the camera would give the curves.
 */
#define RIM_CELLS 0
#define DIRECTED 1 /* a cell looks only at the two neighbours before it in the sweep */
#define MOST_STEPS (USE_DOUBLE ? 64 : 32)
#define ROUNDED (USE_DOUBLE ? 1e-14f : 1e-7f) /* so much of Z is rounding */
#define MARGIN 0.1f /* the direction to the lamp moves U by less than this share of a change of Z */
#define LEFT 0.01f /* share of the way that Z has come down which may be left to the next sweep */

/* `to_p` and `to_q` as in climb.cl. */
static inline number inner_value(const number brightness, const number here, const number left, const number right,
                                 const number up, const number down, const sided to_p, const sided to_q, const axis x,
                                 const axis y, const parameter_set *parameters)
{
    const number at_x = x.coordinate, at_y = y.coordinate, inverse_brightness = (number)1 / brightness;
    const lamp at = lamp_at(at_x, at_y, parameters);
    const sided dx = 1 / (2 * to_p), dy = 1 / (2 * to_q);
    const number highest = least(left + parameters->step_x, up + parameters->step_y);
    const number last = root(square_at(at, nearest_depth(at), brightness, parameters));
    number t = least(last, root(square_at(at, exponential(here), brightness, parameters)));

    const number rise_x = magnitude(dx) * root(multiply_add(at_y, at_y, (number)1));
    const number rise_y = magnitude(dy) * root(multiply_add(at_x, at_x, (number)1));
    const number rise = least(rise_x, rise_y) / at.ray;
    number low = 0, high = last, before = 0, excess_before = 0;
    /* No value lies above that of a surface which faces the lamp. */
    number found = logarithm(depth_at(at, (number)0, inverse_brightness, parameters));
    number least_possible = -NOWHERE, unsettled = -1;
    /* A lane that has settled stays, so that its bits do not depend on how long others take. */
    for (int step = 0; step < MOST_STEPS && any_sign(as_integer(unsettled)); ++step) {
        const number square = t * t;
        const number depth = depth_at(at, square, inverse_brightness, parameters);
        const sight seen = towards(at, (number)1 / depth, at_x, at_y);
        /* Neighbours seen from a surface that faces the lamp. */
        const number from_left = multiply_subtract_from(left, dx * seen.p0, seen.per_facing);
        const number from_up = multiply_subtract_from(up, dy * seen.q0, seen.per_facing);
        const number climbed = least(highest, least_climb(dark_at(square), from_left, from_up, to_p, to_q, seen,
                                                          (number)NOWHERE));
        const number level = logarithm(depth), excess = climbed - level;
        /* The true value lies between, with a margin for U, which falls a little where the direction to the lamp does.
         * Written so that a NaN stays one.
         */
        const number beyond = multiply_add((number)MARGIN, excess, climbed);
        const number above = climbed < level ? level : beyond, below = climbed < level ? beyond : level;
        const number better = above > found ? found : above;
        found = unsettled < (number)0 ? better : found;
        least_possible = most(below, least_possible);
        const number enough = multiply_add((number)LEFT, magnitude(here - found), (number)ROUNDED);
        unsettled = found - least_possible > enough ? unsettled : (number)1;
        if (ONLY_LOWER)
            unsettled = least_possible < here ? unsettled : (number)1;

        low = excess < (number)0 ? t : low;
        high = excess < (number)0 ? high : t;
        const number at_camera = multiply_add(t, dimming_rate(square, parameters), rise);
        const number secant = (excess - excess_before) / (t - before);
        const number slope = step > 0 ? (secant > (number)0.1f * at_camera ? secant : at_camera) : at_camera;
        const number next = t - excess / slope;
        const number middle = high < last ? (number)0.5f * (low + high)
                                          : least(last, multiply_add((number)2, low, (number)0.1f));
        before = t;
        excess_before = excess;
        /* As steep as it may be. */
        unsettled = low >= last ? (number)1 : unsettled;
        /* Secants alone hardly move beside a corner or a jump of U. */
        t = step > 2 && (step & 1) ? middle : (next >= low ? (next <= high ? next : middle) : middle);
    }
    return least(highest, found);
}
