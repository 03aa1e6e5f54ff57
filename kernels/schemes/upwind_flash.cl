/* New values of cells by the upwind scheme, for a light at the camera: the steeper the surface, the larger the ellipse of
 * its gradients, and the lower Z must lie for the brightness seen:
 *
 *     Z = U(t)    the least climb from the neighbours, over edges and triangle as in climb.cl, at steepness t: rises with t
 *     Z = D(t) = -(ln F + dimming(t)) / 2                                                                  falls with t
 *
 * In coordinates around the centre of the ellipse U = base + l, l^2 = offset + slope t^2, for an edge (offset 0) and for
 * the triangle. Where both curves meet is found by a few steps of Newton, and whatever these leave, the larger of U and D
 * is at least the true value: Z comes down to its limit from above.
 *
 * Only the better edge is followed, chosen at the steepness that belongs to the present Z. At the limit that is the true
 * one, so that the limit is that of the full scheme. The other three triangles have their turn in the other three sweeps.
 */
#define RIM_CELLS 0
#define DIRECTED 1 /* a cell looks only at the two neighbours before it in the sweep */
#define MEETING_STEPS (ONLY_LOWER ? 2 : 5) /* of Newton, for the value of a cell */

/* The values where D meets U = base + l, with l^2 = offset + slope t^2, for an edge and a triangle. `square` is the t^2 at
 * which D is `here`.
 *
 * In l the equation 2 U + ln F + dimming = 0 is smooth. The larger of U and D is at least the true value at any l, and
 * lower than the present one between the l at which D is that and the l at which U is. Where values only fall the place is
 * looked for there, so that no value but the true one can stay, and the closer Z is to its limit the closer the two are.
 * Where Newton leads astray it begins again at the turning point of a Lambertian material's curve, from which it seldom
 * does, and later in the middle. Where values may rise it begins there, or later.
 *
 * Both at once, since each step waits for the one before: one hides the other's latency.
 */
#define BOTH __attribute__((opencl_unroll_hint(2))) for (int k = 0; k < 2; ++k)

static inline void meet(const number *base, const number *offset, const number *slope, const number here,
                        const number square, const number shade, const parameter_set *parameters, number *found)
{
    number per_slope[2], low[2], high[2], length[2], fallback[2];
    BOTH {
        per_slope[k] = (number)1 / slope[k];
        const number guess = root(most(multiply_add(slope[k], square, offset[k]), (number)0));
        const number turning_point = root(slope[k] - offset[k]);
#if ONLY_LOWER
        low[k] = guess;
        high[k] = most(low[k], here - base[k]);
        length[k] = guess;
        fallback[k] = most(low[k], least(high[k], turning_point));
#else
        low[k] = 0;
        high[k] = (number)(-0.5f) * (multiply_add((number)2, base[k], shade) +
                                     dimming(-offset[k] * per_slope[k], parameters));
        length[k] = most(low[k], least(high[k], most(guess, turning_point)));
        fallback[k] = (number)0.5f * (low[k] + high[k]);
#endif
        found[k] = NOWHERE;
    }
    for (int step = 0; step <= MEETING_STEPS; ++step)
        BOTH {
            const number steepness = most((number)0, multiply_add(length[k], length[k], -offset[k]) * per_slope[k]);
            const number climbed = base[k] + length[k];
            const number excess = multiply_add((number)2, climbed, shade) + dimming(steepness, parameters);
            /* Written so that a NaN stays one. */
            const number highest = climbed + most((number)0, (number)(-0.5f) * excess);
            found[k] = highest > found[k] ? found[k] : highest;
            if (step == MEETING_STEPS)
                continue;
            const number rise =
                (number)2 + (number)2 * length[k] * per_slope[k] * dimming_rate(steepness, parameters);
            const number next = length[k] - excess / rise;
            high[k] = excess > (number)0 ? length[k] : high[k];
            low[k] = excess > (number)0 ? low[k] : length[k];
            length[k] = next >= low[k] ? (next <= high[k] ? next : fallback[k]) : fallback[k];
            fallback[k] = (number)0.5f * (low[k] + high[k]);
        }
}

/* `to_p` and `to_q` as in climb.cl. */
static inline number inner_value(const number brightness, const number here, const number left, const number right,
                                 const number up, const number down, const sided to_p, const sided to_q, const axis x,
                                 const axis y, const parameter_set *parameters)
{
    const number at_x = x.coordinate, at_y = y.coordinate;
    const number square_x = multiply_add(at_x, at_x, (number)1), square_y = multiply_add(at_y, at_y, (number)1);
    const number ray = multiply_add(at_x, at_x, square_y), inverse_ray = (number)1 / ray;
    const sided scale_x = 2 * to_p, scale_y = 2 * to_q, dx = 1 / scale_x, dy = 1 / scale_y;
    /* Neighbours seen from the centre of the ellipse. */
    const number from_left = multiply_subtract_from(left, dx * at_x, inverse_ray);
    const number from_up = multiply_subtract_from(up, dy * at_y, inverse_ray);
    const number shade = logarithm(brightness);
    const number steepest = (number)(2 * parameters->steepest) * ray;
    const number square = square_of(most((number)0, -multiply_add((number)2, here, shade)), steepest * steepest, parameters);
    const number t = root(square);

    const number climb_x = magnitude(dx) * root(square_y) * inverse_ray;
    const number climb_y = magnitude(dy) * root(square_x) * inverse_ray;
    const number edge_x = multiply_add(climb_x, t, from_left), edge_y = multiply_add(climb_y, t, from_up);
    const number start = edge_x < edge_y ? from_left : from_up, climb = edge_x < edge_y ? climb_x : climb_y;

    const number xx = square_x * (scale_x * scale_x), yy = square_y * (scale_y * scale_y);
    const number xy = at_x * at_y * (scale_x * scale_y);
    const number step = from_up - from_left, column_x = xx + xy, column_y = xy + yy;
    const number inverse_bend = (number)1 / (column_x + column_y);
    const number base = multiply_add(step, column_y * inverse_bend, from_left);
    const number width = step * (scale_x * scale_y) * inverse_bend;
    const number bases[2] = {start, base}, offsets[2] = {(number)0, -(ray * width) * width};
    const number slopes_of_both[2] = {climb * climb, inverse_bend * inverse_ray};
    number found[2];
    meet(bases, offsets, slopes_of_both, here, square, shade, parameters, found);
    const number climb_left = found[1] - from_left, climb_up = found[1] - from_up;
    const number normal_x = multiply_add(xx, climb_left, xy * climb_up);
    const number normal_y = multiply_add(xy, climb_left, yy * climb_up);
    const number both_there = (number)(0.5f * NOWHERE) - magnitude(step);
    const number accepted = least(least(normal_x, normal_y), both_there);
    const number triangle = accepted > (number)0 ? found[1] : (number)NOWHERE;

    const number highest = least(left + parameters->step_x, up + parameters->step_y);
    /* No value lies above that of a surface which faces the light. */
    const number facing = (number)(-0.5f) * (shade + dimming((number)0, parameters));
    return least(least(highest, facing), least(triangle, found[0]));
}
