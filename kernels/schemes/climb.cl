/* The value of a cell by the upwind scheme, where the sublevel set K = {P : H(P) <= 0} is bounded by a conic: Z is the
 * largest function whose gradient nowhere leaves K.
 *
 *     edge       Z = Z_l + dx max {p : P in K}
 *     triangle   P = ((Z - Z_l) / dx, (Z - Z_u) / dy) on the conic: a quadratic in Z, of which the larger root counts,
 *                if the characteristic comes from between the two neighbours: if the conic's outward normal at P points
 *                away from both
 *
 * The value is the least of both edges and the triangle between the two neighbours that come before the cell in the
 * sweep. The other three triangles have their turn in the other three sweeps; all four together make the scheme. A
 * neighbour that is missing has the value NOWHERE: nothing flows in from there.
 *
 * For the lanes of one vector; it reads no memory. `dark` is 1 - E^2, and `at` what the model wants of the light. The
 * signs of `to_p` and `to_q`, 1 / (2 dx) and 1 / (2 dy), say where left and up lie, and whether Z or -Z is solved for.
 * An edge climbs no faster than `steepest`, which matters where K is unbounded.
 */
static inline number least_climb(const number dark, const number left, const number up, const sided to_p,
                                 const sided to_q, const light_frame at, const number steepest)
{
    const sided ahead = 1, turn_x = to_p < 0 ? -ahead : ahead, turn_y = to_q < 0 ? -ahead : ahead;
    const sided scale_x = 2 * to_p, scale_y = 2 * to_q, dx = turn_x / scale_x, dy = turn_y / scale_y;
    const number climb_x = steepest_climb(dark, 0, turn_x, at);
    const number climb_y = steepest_climb(dark, 1, turn_y, at);
    const number edge = least(left + dx * least(steepest, climb_x), up + dy * least(steepest, climb_y));

    /* The quadratic in Z - Z_l: bend z^2 + 2 tilt z + rest = 0. */
    const conic set = sublevel_set(dark, at);
    const number xx = set.xx * (scale_x * scale_x), xy = set.xy * (scale_x * scale_y);
    const number yy = set.yy * (scale_y * scale_y);
    const number along_x = set.x * scale_x, along_y = set.y * scale_y;
    const number step = up - left;
    const number column_x = xx + xy, column_y = xy + yy, bend = column_x + column_y, along = along_x + along_y;
    const number tilt = fnma(column_y, step, along);
    const number rest = multiply_add(step, fnma(2, along_y, yy * step), set.free);
    /* tilt^2 - bend rest, as a polynomial in the step. */
    const number spread =
        multiply_add(step,
                     multiply_add(step, fnma(xx, yy, xy * xy), 2 * fnma(along_x, column_y, along_y * column_x)),
                     fnma(bend, set.free, along * along));
    const number square_root = root(most(spread, 0));
    const number climb = (tilt < 0 ? square_root - tilt : -rest) / (tilt < 0 ? bend : tilt + square_root);
    const number climb_up = climb - step;
    const number p = scale_x * climb, q = scale_y * climb_up;
    const number normal_x = multiply_add(xx, climb, multiply_add(xy, climb_up, along_x));
    const number normal_y = multiply_add(xy, climb, multiply_add(yy, climb_up, along_y));
    const number side = lit_side(p, q, at);
    const number both_there = 0.5f * NOWHERE - magnitude(step);
    const number worst = least(least(least(normal_x, normal_y), least(side, spread)), both_there);
    const number triangle = choose(worst > 0, left + climb, NOWHERE);
    return least(triangle, edge);
}
