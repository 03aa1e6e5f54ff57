/* New values of cells by the upwind scheme, for a lamp off the optical axis, off_axis_lamp.cl. As in upwind_flash.cl
 * two curves over t = tan theta intersect,
 *
 *     Z = U(t)    least climb from the neighbours, climb.cl, at the angle theta to the lamp: rises with t
 *     Z = D(t)    at which the surface has the brightness F, rho^2 F = c(t): falls with t
 *
 * and the true value lies between both, whatever t, but for a small margin: Z comes down to its limit from above. U has
 * no closed form, since the direction to the lamp depends on Z, so that the intersection is found by secants; the first
 * step takes the slopes that the curves would have with the lamp at the camera.
 *
 * For the lanes of one vector; it reads no memory.
 */
#define RIM_CELLS 0 /* a missing neighbour has the value NOWHERE: no cell is treated apart */
#define DIRECTED 1  /* a cell reads only the two neighbours before it in the sweep */
#define MOST_STEPS (USE_DOUBLE ? 64 : 32)
#define ROUNDED (USE_DOUBLE ? 1e-14f : 1e-7f) /* rounding error of Z */
#define MARGIN 0.1f /* the direction to the lamp moves U by less than this share of a change of Z */
#define REMAINDER 0.01f /* share of the change of Z that may be left to the next sweep */

/* U at t^2 = `square`, where the direction to the lamp is that at the depth 1 / `inverse_depth`. */
static inline number climb_to(const number square, const number inverse_depth, const number left, const number up,
                              const sided to_p, const sided to_q, const lamp at, const number x, const number y)
{
    const light_frame seen = towards(at, inverse_depth, x, y);
    const sided dx = 1 / (2 * to_p), dy = 1 / (2 * to_q);
    /* Neighbours seen from a surface that faces the lamp. */
    const number from_left = fnma(dx * seen.p0, seen.per_facing, left);
    const number from_up = fnma(dy * seen.q0, seen.per_facing, up);
    return least_climb(dark_at(square), from_left, from_up, to_p, to_q, seen, NOWHERE);
}

/* `to_p` and `to_q` as in climb.cl. */
static inline number inner_value(const number brightness, const number here, const number left, const number right,
                                 const number up, const number down, const sided to_p, const sided to_q, const axis x,
                                 const axis y, const parameter_set *parameters)
{
    const number at_x = x.coordinate, at_y = y.coordinate;
    const lamp at = lamp_at(at_x, at_y, parameters);
    const sided dx = 1 / (2 * to_p), dy = 1 / (2 * to_q);
    const number highest = least(left + parameters->step_x, up + parameters->step_y);

    /* Most cells get no lower value in most sweeps: where U is not below `here` at the t at which D is. */
    const number depth_here = exponential(here), square_here = square_at(at, depth_here, brightness, parameters);
    const number climb_here = climb_to(square_here, 1 / depth_here, left, up, to_p, to_q, at, at_x, at_y);
    const number falls = choose(least(climb_here, highest) < here, -1, 1);
    if (ONLY_LOWER && !any_sign(as_integer(falls)))
        return NOWHERE;

    const number inverse_brightness = 1 / brightness;
    const number last = root(square_at(at, nearest_depth(at), brightness, parameters));
    number t = least(last, root(square_here));

    const number rise_x = magnitude(dx) * root(multiply_add(at_y, at_y, 1));
    const number rise_y = magnitude(dy) * root(multiply_add(at_x, at_x, 1));
    const number rise = least(rise_x, rise_y) / at.ray;
    number low = 0, high = last, before = 0, excess_before = 0;
    /* No value lies above that of a surface which faces the lamp. */
    number found = logarithm(depth_at(at, 0, inverse_brightness, parameters));
    number least_possible = -NOWHERE, unsettled = -1;
    /* A lane that has settled stays, so that its bits do not depend on how long others take. */
    for (int step = 0; step < MOST_STEPS && any_sign(as_integer(unsettled)); ++step) {
        const number square = t * t;
        const number depth = depth_at(at, square, inverse_brightness, parameters);
        const number climb = climb_to(square, 1 / depth, left, up, to_p, to_q, at, at_x, at_y);
        const number climbed = least(highest, climb);
        const number level = logarithm(depth), excess = climbed - level;
        /* The true value lies between, with a margin for U, which falls a little where the direction to the lamp does.
         * Written so that a NaN stays one.
         */
        const number beyond = multiply_add(MARGIN, excess, climbed);
        const number above = climbed < level ? level : beyond, below = climbed < level ? beyond : level;
        const number better = above > found ? found : above;
        found = unsettled < 0 ? better : found;
        least_possible = most(below, least_possible);
        const number enough = multiply_add(REMAINDER, magnitude(here - found), ROUNDED);
        unsettled = choose(found - least_possible > enough, unsettled, 1);
        if (ONLY_LOWER)
            unsettled = choose(least_possible < here, unsettled, 1);

        low = excess < 0 ? t : low;
        high = excess < 0 ? high : t;
        const number at_camera = multiply_add(t, minus_log_c_derivative(square, parameters), rise);
        const number secant = (excess - excess_before) / (t - before);
        const number slope = step > 0 ? (secant > 0.1f * at_camera ? secant : at_camera) : at_camera;
        const number next = t - excess / slope;
        const number middle = high < last ? 0.5f * (low + high) : least(last, multiply_add(2, low, 0.1f));
        before = t;
        excess_before = excess;
        /* As steep as possible. */
        unsettled = choose(low >= last, 1, unsettled);
        /* Near a kink or a jump of U secants alone hardly move. */
        t = step > 2 && (step & 1) ? middle : (next >= low ? (next <= high ? next : middle) : middle);
    }
    return ONLY_LOWER ? choose(falls < 0, least(highest, found), NOWHERE) : least(highest, found);
}
