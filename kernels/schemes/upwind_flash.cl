/* New values of cells by the upwind scheme, for a light at the camera that fades, flash_light.cl. The steeper the
 * surface, t = tan theta, the larger the ellipse of its gradients, and the lower Z must lie for the brightness F:
 *
 *     Z = U(t), the least climb from the neighbours, over edges and triangle as in climb.cl, which rises with t
 *     Z = D(t) = (ln c(t) - ln F) / 2, which falls with t
 *
 * In coordinates around the centre of the ellipse U = base + l, l^2 = offset + slope t^2, for an edge (offset 0) and
 * for the triangle. The true value is where both curves meet. The larger of U and D is at least that, at any l: Z comes
 * down to its limit from above.
 *
 * Only the better edge is followed, the one on which the present Z would be steeper. At the limit that is the one which
 * counts, so that the limit is that of the full scheme. The other three triangles have their turn in the other three
 * sweeps.
 *
 * For the lanes of one vector; it reads no memory.
 */
#define RIM_CELLS 0 /* a missing neighbour has the value NOWHERE: no cell is treated apart */
#define DIRECTED 1  /* a cell reads only the two neighbours before it in the sweep */
#define NEAR_ENOUGH (1 / 64.0f) /* largest change of Z over which the quadratic of meet() is trusted */
#define VERY_NEAR (USE_DOUBLE ? 1e-7f : 3e-4f) /* so that what its bound leaves is below rounding */
#define REMAINDER 0.01f /* share of the change of Z that may be left to the next sweep */
#define ROUNDED (USE_DOUBLE ? 1e-14f : 1e-7f) /* rounding error of Z */
#define MOST_ROUNDS 16
#define LAMBERTIAN (NEWTON_STEPS == 0)

/* Where both curves meet, for an edge and a triangle, or a value above that. `square` is the t^2 at which D is `begin`,
 * or nearly, where Newton's method had to find it.
 *
 * With m = -ln c as a linear function of t^2 around the place where D is Z_r, at first `begin`, and t is t_r,
 *
 *     2 (base + l - Z_r) + m'(t_r^2) (l^2 - l_r^2) / slope = 0,    l_r^2 = offset + slope t_r^2
 *
 * is a quadratic, l^2 + 2 bend l = rest. Where Z_r is `here`, its first root lies between the l at which D is `here`
 * and that at which U is, whatever the material, and so leads to a value below `here`. How far it is from the true one
 * is of second order in how far it leads from Z_r: for a Lambertian material, whose m is concave, it is not beyond it,
 * and short of it by at most 5 (Z - Z_r)^2 bend / (2 bend + l), as long as that is `near`, upwards or downwards.
 * With so much more it is beyond, where U is the larger of both, and far less steep than D: that is the value, for
 * which no logarithm is wanted. Where it is not near enough, and for other materials, the larger of both is the value,
 * and where that is D, by more than a share of the change, the place found is the next to begin from.
 *
 * From a neighbour that is not there come numbers without meaning, or none: these count for nothing.
 *
 * Edge and triangle together, since each step waits for the one before: one hides the latency of the other.
 */
#define BOTH __attribute__((opencl_unroll_hint(2))) for (int k = 0; k < 2; ++k)

static inline void meet(const number *base, const number *offset, const number *slope, const number here,
                        const number begin, const number square, const number near, const number log_f,
                        const parameter_set *parameters, number *found)
{
    number per_slope[2], level[2], t_square[2], going[2];
    BOTH {
        per_slope[k] = 1 / slope[k];
        level[k] = LAMBERTIAN ? begin : -0.5f * (log_f + minus_log_c(square, parameters));
        t_square[k] = square;
        going[k] = -1;
        found[k] = NOWHERE;
    }
    for (int again = 0; again < MOST_ROUNDS && any_sign(as_integer(going[0]) | as_integer(going[1])); ++again) {
        number length[2], up[2], moved[2], far[2];
        BOTH {
            const number bend = slope[k] / minus_log_c_derivative(t_square[k], parameters);
            const number square_length = most(0, multiply_add(slope[k], t_square[k], offset[k]));
            const number rest = most(0, multiply_add(2 * bend, level[k] - base[k], square_length));
            const number inverse = 1 / (bend + root(multiply_add(bend, bend, rest)));
            const number first_root = rest * inverse;
            moved[k] = base[k] + first_root - level[k];
            length[k] = multiply_add((5 * moved[k]) * moved[k], bend * inverse, first_root);
            up[k] = base[k] + length[k];
            far[k] = choose(magnitude(moved[k]) > near, going[k], 1);
        }
        if (LAMBERTIAN && !any_sign(as_integer(far[0]) | as_integer(far[1]))) {
            BOTH found[k] = choose(going[k] < 0, least(up[k], found[k]), found[k]);
            return;
        }
        BOTH {
            const number steepness = most(0, multiply_add(length[k], length[k], -offset[k]) * per_slope[k]);
            const number excess = multiply_add(2, up[k], log_f) + minus_log_c(steepness, parameters);
            const number down = multiply_add(-0.5f, excess, up[k]);
            const number both = most(up[k], down), highest = LAMBERTIAN ? choose(far[k] < 0, both, up[k]) : both;
            /* A lane that is near enough stays, so that its bits do not depend on how long others take. */
            found[k] = choose(going[k] < 0, least(highest, found[k]), found[k]);
            level[k] = down;
            t_square[k] = steepness;
            const number left = down - up[k] - multiply_add(REMAINDER, magnitude(here - found[k]), ROUNDED);
            going[k] = LAMBERTIAN ? far[k] : choose(left > 0, going[k], far[k]);
        }
    }
}

/* `to_p` and `to_q` as in climb.cl. */
static inline number inner_value(const number log_f, const number here, const number left, const number right,
                                 const number up, const number down, const sided to_p, const sided to_q, const axis x,
                                 const axis y, const parameter_set *parameters)
{
    const number at_x = x.coordinate, at_y = y.coordinate;
    const number square_x = multiply_add(at_x, at_x, 1), square_y = multiply_add(at_y, at_y, 1);
    const number ray = multiply_add(at_x, at_x, square_y);
    const sided scale_x = 2 * to_p, scale_y = 2 * to_q, dx = 1 / scale_x, dy = 1 / scale_y;
    const number xx = square_x * (scale_x * scale_x), yy = square_y * (scale_y * scale_y);
    const number xy = at_x * (at_y * (scale_x * scale_y));

    /* The climb from the neighbours to `here`, times R^2, seen from the centre of the ellipse, and the normal there: of
     * a triangle that this normal belongs to, and else of the better edge, t^2 = steep / wide.
     */
    const number over_left = multiply_add(here - left, ray, dx * at_x);
    const number over_up = multiply_add(here - up, ray, dy * at_y);
    const number normal_x = multiply_add(xx, over_left, xy * over_up);
    const number normal_y = multiply_add(xy, over_left, yy * over_up);
    const number wide_x = (dx * dx) * square_y, wide_y = (dy * dy) * square_x;
    const number climb_x = most(0, over_left), climb_y = most(0, over_up);
    const integer along_x = climb_x * climb_x * wide_y > climb_y * climb_y * wide_x;
    const number climb = along_x ? climb_x : climb_y, wide_edge = along_x ? wide_x : wide_y;
    const integer between = (normal_x > 0) & (normal_y > 0);
    const number steep = between ? multiply_add(over_left, normal_x, over_up * normal_y) : climb * climb;
    const number wide = between ? ray : wide_edge;

    /* The curves meet below `here` if and only if U is there steeper than D. Most cells get no lower value in most
     * sweeps: then this is all.
     */
    const number target = most(0, -multiply_add(2, here, log_f));
    const number highest = least(left + parameters->step_x, up + parameters->step_y);
    /* NaN where the brightness is. */
    const number excess = excess_of(steep, wide, target, parameters), falls = most(here - highest, excess);
    if (ONLY_LOWER && !any_sign(as_integer(choose(falls > 0, -1, 1))))
        return NOWHERE;

    const number column_x = xx + xy, column_y = xy + yy, sum = column_x + column_y;
    const number inverse_slope = 1 / (ray * sum), inverse_ray = inverse_slope * sum, inverse_sum = inverse_slope * ray;
    const number from_left = fnma(dx * at_x, inverse_ray, left);
    const number from_up = fnma(dy * at_y, inverse_ray, up);
    const number step = from_up - from_left;
    const number width = step * (scale_x * scale_y) * inverse_sum;
    const number bases[2] = {along_x ? from_left : from_up,
                             multiply_add(step, column_y * inverse_sum, from_left)};
    const number offsets[2] = {(number)0, -(ray * width) * width};
    const number slopes_of_both[2] = {wide_edge * (inverse_ray * inverse_ray), inverse_slope};
    const number steepest = 2 * parameters->steepest * ray, most_square = steepest * steepest;
    /* Far above where the curves meet, as before its first sweep, a value will come to lie near its neighbour: begin
     * there. Where the surface is steep, the value lies far above its neighbour at the limit too. If it began there in
     * every sweep, it would be left as far above the limit as the bound in meet() is: the value must begin from itself
     * once it is near. One that is not far_beyond() is within ln 2 / 4 of the limit, by D. One that is has farther to
     * go than a step from the neighbour leaves.
     */
    const number neighbour = along_x ? left : up;
    const integer distant = (here - neighbour > NEAR_ENOUGH) & far_beyond(excess, wide, target);
    number begin = here, square;
    /* Apart, since what begins from `here` shares its exponential with the rejection above. */
    if (any_sign(as_integer(choose(distant, -1, 1)))) {
        begin = choose(distant, neighbour, here);
        square = square_of(most(0, -multiply_add(2, begin, log_f)), most_square, parameters);
    } else
        square = square_of(target, most_square, parameters);
    /* At the largest t^2 D is above that, and stays so, however often the value begins there. */
    const integer steeper = square >= most_square;
    if (LAMBERTIAN && any_sign(as_integer(choose(steeper, -1, 1))))
        begin = choose(steeper, -0.5f * (log_f + minus_log_c(square, parameters)), begin);
    const number near = choose(steeper, VERY_NEAR, NEAR_ENOUGH);
    number found[2];
    meet(bases, offsets, slopes_of_both, here, begin, square, near, log_f, parameters, found);
    const number climb_left = found[1] - from_left, climb_up = found[1] - from_up;
    const number facing_x = multiply_add(xx, climb_left, xy * climb_up);
    const number facing_y = multiply_add(xy, climb_left, yy * climb_up);
    const number both_there = 0.5f * NOWHERE - magnitude(step);
    const number accepted = least(least(facing_x, facing_y), both_there);
    const number triangle = choose(accepted > 0, found[1], NOWHERE);
#if ONLY_LOWER
    return choose(falls > 0, least(highest, least(triangle, found[0])), NOWHERE);
#else
    /* No value lies above that of a surface which faces the light. */
    const number facing = -0.5f * (log_f + minus_log_c(0, parameters));
    const number value = least(least(highest, facing), least(triangle, found[0]));
    return choose(log_f == log_f, value, NOWHERE);
#endif
}
