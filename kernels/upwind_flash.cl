/* New values of cells by the upwind scheme, for a light at the camera: the steeper the surface, the larger the ellipse of
 * its gradients, and the lower Z must lie for the brightness seen:
 *
 *     Z = U(t)    the least climb from the neighbours, over edges and triangle as in upwind.cl, at steepness t: rises with t
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
#define LAMBERTIAN_STEPS 5

/* t^2 at which the material has dimmed by so much; in ln(1 + t^2), of which all materials make nearly a straight line. */
static inline number square_of(const number dimmed, const number highest, const real *material)
{
    number low = 0, high = logarithm((number)1 + highest);
    number stretch = least(high, (number)2 * dimmed); /* exact for a Lambertian material */
#if NEWTON_STEPS > LAMBERTIAN_STEPS
    for (int step = 0; step < NEWTON_STEPS; ++step) {
        const number square = exponential(stretch) - (number)1;
        const number excess = dimming(square, material) - dimmed;
        high = excess > (number)0 ? stretch : high;
        low = excess > (number)0 ? low : stretch;
        const number next = stretch - excess / (dimming_rate(square, material) * ((number)1 + square));
        stretch = next >= low ? (next <= high ? next : (number)0.5f * (low + high)) : (number)0.5f * (low + high);
    }
#endif
    return exponential(stretch) - (number)1;
}

/* Where U = base + l and D meet, with l^2 = offset + slope t^2: the value there. `square` is a guess of t^2.
 *
 * In l the equation 2 U + ln F + dimming = 0 is smooth, and rises at least with 2, which gives the bracket. Newton starts
 * no lower than where a Lambertian material's curve has its turning point, from which it cannot go astray.
 */
static inline number meet(const number base, const number offset, const number slope, const number square,
                          const number shade, const real *material)
{
    const number per_slope = (number)1 / slope;
    const number guess = root(most(multiply_add(slope, square, offset), (number)0));
    number low = 0;
    number high = low - (number)0.5f * (multiply_add((number)2, base + low, shade) +
                                        dimming(-offset * per_slope, material));
    number length = most(low, least(high, most(guess, root(slope - offset))));
    for (int step = 0; step < NEWTON_STEPS; ++step) {
        const number steepness = most((number)0, multiply_add(length, length, -offset) * per_slope);
        const number excess = multiply_add((number)2, base + length, shade) + dimming(steepness, material);
        high = excess > (number)0 ? length : high;
        low = excess > (number)0 ? low : length;
        const number rise = (number)2 + (number)2 * length * per_slope * dimming_rate(steepness, material);
        const number next = length - excess / rise;
        length = next >= low ? (next <= high ? next : (number)0.5f * (low + high)) : (number)0.5f * (low + high);
    }
    const number steepness = most((number)0, multiply_add(length, length, -offset) * per_slope);
    return most(base + length, (number)(-0.5f) * (shade + dimming(steepness, material)));
}

/* `to_p` and `to_q` as in upwind.cl. */
static inline number inner_value(const number brightness, const number here, const number left, const number right,
                                 const number up, const number down, const real to_p, const real to_q, const axis x,
                                 const axis y, const real *parameters)
{
    const real *material = parameters + MATERIAL_FIRST;
    const real turn_x = to_p < 0 ? -1 : 1, turn_y = to_q < 0 ? -1 : 1;
    const number here_x = turn_x * x.coordinate, here_y = turn_y * y.coordinate;
    const number square_x = multiply_add(here_x, here_x, (number)1), square_y = multiply_add(here_y, here_y, (number)1);
    const number ray = multiply_add(here_x, here_x, square_y), inverse_ray = (number)1 / ray;
    const real scale_x = 2 * (turn_x * to_p), scale_y = 2 * (turn_y * to_q), dx = 1 / scale_x, dy = 1 / scale_y;
    /* Neighbours seen from the centre of the ellipse. */
    const number from_left = multiply_subtract_from(left, dx * here_x, inverse_ray);
    const number from_up = multiply_subtract_from(up, dy * here_y, inverse_ray);
    const number shade = logarithm(brightness);
    const number steepest = (number)(2 * parameters[STEEPEST]) * ray;
    const number square = square_of(most((number)0, -multiply_add((number)2, here, shade)), steepest * steepest, material);
    const number t = root(square);

    const number climb_x = dx * root(square_y) * inverse_ray, climb_y = dy * root(square_x) * inverse_ray;
    const number edge_x = multiply_add(climb_x, t, from_left), edge_y = multiply_add(climb_y, t, from_up);
    const number start = edge_x < edge_y ? from_left : from_up, climb = edge_x < edge_y ? climb_x : climb_y;
    const number edge = meet(start, (number)0, climb * climb, square, shade, material);

    const number xx = square_x * (scale_x * scale_x), yy = square_y * (scale_y * scale_y);
    const number xy = here_x * here_y * (scale_x * scale_y);
    const number step = from_up - from_left, column_x = xx + xy, column_y = xy + yy;
    const number inverse_bend = (number)1 / (column_x + column_y);
    const number base = multiply_add(step, column_y * inverse_bend, from_left);
    const number width = step * (scale_x * scale_y) * inverse_bend;
    const number offset = -(ray * width) * width, slope = inverse_bend * inverse_ray;
    const number found = meet(base, offset, slope, square, shade, material);
    const number climb_left = found - from_left, climb_up = found - from_up;
    const number normal_x = multiply_add(xx, climb_left, xy * climb_up);
    const number normal_y = multiply_add(xy, climb_left, yy * climb_up);
    const number both_there = (number)(0.5f * NOWHERE) - magnitude(step);
    const number accepted = least(least(normal_x, normal_y), both_there);
    const number triangle = accepted > (number)0 ? found : (number)NOWHERE;

    const number highest = least(left + parameters[STEP_X], up + parameters[STEP_Y]);
    return least(highest, least(triangle, edge));
}
