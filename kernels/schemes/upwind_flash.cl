/* New values of cells by the upwind scheme, for a light at the camera that fades, flash_light.cl. The steeper the
 * surface, t = tan theta, the larger the ellipse of its gradients, and the lower Z must lie for the brightness F:
 *
 *     Z = U(t), the least climb from the neighbours, over edges and triangle as in climb.cl, which rises with t
 *     Z = D(t) = (ln c(t) - ln F) / 2, which falls with t
 *
 * In coordinates around the centre of the ellipse U = base + l, l^2 = offset + slope t^2, for an edge (offset 0) and
 * for the triangle. Some Newton steps approach the intersection of both curves. Whatever these leave, the larger of U
 * and D is at least the true value: Z comes down to its limit from above.
 *
 * Only the better edge is followed, chosen at the steepness that belongs to the present Z. At the limit that is the
 * true one, so that the limit is that of the full scheme. The other three triangles have their turn in the other three
 * sweeps.
 *
 * For the lanes of one vector; it reads no memory.
 */
#define RIM_CELLS 0 /* a missing neighbour has the value NOWHERE: no cell is treated apart */
#define DIRECTED 1  /* a cell reads only the two neighbours before it in the sweep */
#define MEETING_STEPS (ONLY_LOWER ? 2 : 5) /* of Newton's method, for the value of a cell */

/* The intersections of D with U = base + l, l^2 = offset + slope t^2, for an edge and a triangle. `square` is the t^2
 * at which D is `here`.
 *
 * In l the equation 2 U + ln F - ln c = 0 is smooth. The larger of U and D is at least the true value at any l, and
 * lower than the present one between the l at which D is that and the l at which U is. Where values only fall the root
 * is sought there, so that no value but the true one can stay, and the closer Z is to its limit the shorter is this
 * interval. A Newton step that leaves it is replaced, the first time by the inflection point of a Lambertian material's
 * curve, from which Newton's method seldom leaves it, and then by the middle. Where values may rise it starts at that
 * point, or farther out.
 *
 * Edge and triangle together, since each step waits for the one before: one hides the latency of the other.
 */
#define BOTH __attribute__((opencl_unroll_hint(2))) for (int k = 0; k < 2; ++k)

static inline void meet(const number *base, const number *offset, const number *slope, const number here,
                        const number square, const number log_f, const parameter_set *parameters, number *found)
{
    number per_slope[2], low[2], high[2], length[2], fallback[2];
    BOTH {
        per_slope[k] = 1 / slope[k];
        const number guess = root(most(multiply_add(slope[k], square, offset[k]), 0));
        const number inflection = root(slope[k] - offset[k]);
#if ONLY_LOWER
        low[k] = guess;
        high[k] = most(low[k], here - base[k]);
        length[k] = guess;
        fallback[k] = most(low[k], least(high[k], inflection));
#else
        low[k] = 0;
        high[k] = -0.5f * (multiply_add(2, base[k], log_f) + minus_log_c(-offset[k] * per_slope[k], parameters));
        length[k] = most(low[k], least(high[k], most(guess, inflection)));
        fallback[k] = 0.5f * (low[k] + high[k]);
#endif
        found[k] = NOWHERE;
    }
    for (int step = 0; step <= MEETING_STEPS; ++step)
        BOTH {
            const number t_square = most(0, multiply_add(length[k], length[k], -offset[k]) * per_slope[k]);
            const number climbed = base[k] + length[k];
            const number excess = multiply_add(2, climbed, log_f) + minus_log_c(t_square, parameters);
            /* Written so that a NaN stays one. */
            const number highest = climbed + most(0, -0.5f * excess);
            found[k] = highest > found[k] ? found[k] : highest;
            if (step == MEETING_STEPS)
                continue;
            const number rise = 2 + 2 * length[k] * per_slope[k] * minus_log_c_derivative(t_square, parameters);
            const number next = length[k] - excess / rise;
            high[k] = excess > 0 ? length[k] : high[k];
            low[k] = excess > 0 ? low[k] : length[k];
            length[k] = next >= low[k] ? (next <= high[k] ? next : fallback[k]) : fallback[k];
            fallback[k] = 0.5f * (low[k] + high[k]);
        }
}

/* `to_p` and `to_q` as in climb.cl. */
static inline number inner_value(const number brightness, const number here, const number left, const number right,
                                 const number up, const number down, const sided to_p, const sided to_q, const axis x,
                                 const axis y, const parameter_set *parameters)
{
    const number at_x = x.coordinate, at_y = y.coordinate;
    const number square_x = multiply_add(at_x, at_x, 1), square_y = multiply_add(at_y, at_y, 1);
    const number ray = multiply_add(at_x, at_x, square_y), inverse_ray = 1 / ray;
    const sided scale_x = 2 * to_p, scale_y = 2 * to_q, dx = 1 / scale_x, dy = 1 / scale_y;
    /* Neighbours seen from the centre of the ellipse. */
    const number from_left = fnma(dx * at_x, inverse_ray, left);
    const number from_up = fnma(dy * at_y, inverse_ray, up);
    const number log_f = logarithm(brightness);
    const number steepest = 2 * parameters->steepest * ray;
    const number square = square_of(most(0, -multiply_add(2, here, log_f)), steepest * steepest, parameters);
    const number t = root(square);

    const number climb_x = magnitude(dx) * root(square_y) * inverse_ray;
    const number climb_y = magnitude(dy) * root(square_x) * inverse_ray;
    const number edge_x = multiply_add(climb_x, t, from_left), edge_y = multiply_add(climb_y, t, from_up);
    const number start = edge_x < edge_y ? from_left : from_up, climb = edge_x < edge_y ? climb_x : climb_y;

    const number xx = square_x * (scale_x * scale_x), yy = square_y * (scale_y * scale_y);
    const number xy = at_x * at_y * (scale_x * scale_y);
    const number step = from_up - from_left, column_x = xx + xy, column_y = xy + yy;
    const number inverse_bend = 1 / (column_x + column_y);
    const number base = multiply_add(step, column_y * inverse_bend, from_left);
    const number width = step * (scale_x * scale_y) * inverse_bend;
    const number bases[2] = {start, base}, offsets[2] = {(number)0, -(ray * width) * width};
    const number slopes_of_both[2] = {climb * climb, inverse_bend * inverse_ray};
    number found[2];
    meet(bases, offsets, slopes_of_both, here, square, log_f, parameters, found);
    const number climb_left = found[1] - from_left, climb_up = found[1] - from_up;
    const number normal_x = multiply_add(xx, climb_left, xy * climb_up);
    const number normal_y = multiply_add(xy, climb_left, yy * climb_up);
    const number both_there = 0.5f * NOWHERE - magnitude(step);
    const number accepted = least(least(normal_x, normal_y), both_there);
    const number triangle = choose(accepted > 0, found[1], NOWHERE);

    const number highest = least(left + parameters->step_x, up + parameters->step_y);
    /* No value lies above that of a surface which faces the light. */
    const number facing = -0.5f * (log_f + minus_log_c(0, parameters));
    return least(least(highest, facing), least(triangle, found[0]));
}
