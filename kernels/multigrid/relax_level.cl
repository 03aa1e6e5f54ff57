/* A level of the multigrid method too large for one work-group: its cells relaxed, red ones and black ones in turn, the
 * residual of the equation, and how far values have moved.
 *
 * A work-item takes LANES cells of a row, global size (at least width / LANES, height), but for largest_changes. Each
 * vector is computed whole, and the cells of one colour are taken from it: values go from one array to another, so that
 * nobody reads what somebody else writes.
 */
#if LANES == 16
#define LANE_NUMBERS ((integer)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#elif LANES == 8
#define LANE_NUMBERS ((integer)(0, 1, 2, 3, 4, 5, 6, 7))
#elif LANES == 4
#define LANE_NUMBERS ((integer)(0, 1, 2, 3))
#elif LANES == 2
#define LANE_NUMBERS ((integer)(0, 1))
#else
#define LANE_NUMBERS ((integer)0)
#endif

__kernel void relax_colour(__global const real *values,     /* W                                       */
                           __global real *relaxed_values,   /* result: W with one colour relaxed       */
                           __global const real *brightness, /* NaN where not solved                    */
                           __global const real *weights_x,  /* sigma_x / (2 dx)                        */
                           __global const real *weights_y,
                           __global const real *source,     /* f                                       */
                           __global const real *axes,       /* tables, see grid_level.cl               */
                           __global const int *levels,
                           __global const parameter_set *parameters, /* of each level                  */
                           const int level,
                           const int colour,                /* 0 or 1, of row + column                 */
                           const int with_source)           /* 0 where f = 0                           */
{
    const grid_level here = level_at(levels, level);
    const int column = (int)get_global_id(0) * LANES, row = (int)get_global_id(1);
    if (column >= here.width)
        return;
    const parameter_set own = parameters[level];
    const size_t at = place_of(here, column, row);
    __global const real *x = axes + AXIS_PLANES * here.columns + column, *y = axes + AXIS_PLANES * here.rows + row;
    const number wanted = choose(with_source != 0, LOAD(source + at), 0);
    const number next = relaxed_value(values + at, here.stride, LOAD(brightness + at), LOAD(weights_x + at),
                                      LOAD(weights_y + at), wanted, LOAD(x), y[0], &own);
    const integer parity = (LANE_NUMBERS + (integer)(row + column + colour)) & 1;
    STORE(relaxed_values + at, parity == 0 ? next : LOAD(values + at));
}

__kernel void find_residual(__global const real *values,
                            __global real *residual, /* result: f - N(W), 0 where not solved */
                            __global const real *brightness,
                            __global const real *weights_x,
                            __global const real *weights_y,
                            __global const real *source,
                            __global const real *axes,
                            __global const int *levels,
                            __global const parameter_set *parameters,
                            const int level,
                            const int with_source)
{
    const grid_level here = level_at(levels, level);
    const int column = (int)get_global_id(0) * LANES, row = (int)get_global_id(1);
    if (column >= here.width)
        return;
    const parameter_set own = parameters[level];
    const size_t at = place_of(here, column, row);
    __global const real *x = axes + AXIS_PLANES * here.columns + column, *y = axes + AXIS_PLANES * here.rows + row;
    const number wanted = choose(with_source != 0, LOAD(source + at), 0);
    STORE(residual + at, residual_at(values + at, here.stride, LOAD(brightness + at), LOAD(weights_x + at),
                                     LOAD(weights_y + at), wanted, LOAD(x), y[0], &own));
}

/* The largest change of a row, NOWHERE where one is not finite; a work-item takes a row. */
__kernel void largest_changes(__global const real *values,
                              __global const real *values_before,
                              __global const real *brightness, /* NaN where not solved   */
                              __global real *changes,          /* result, shape (height,) */
                              __global const int *levels,
                              const int level)
{
    const grid_level here = level_at(levels, level);
    const int row = (int)get_global_id(0);
    if (row >= here.height)
        return;
    number largest = 0;
    for (int column = 0; column < here.width; column += LANES) {
        const size_t at = place_of(here, column, row);
        const number light = LOAD(brightness + at);
        const number change = magnitude(LOAD(values + at) - LOAD(values_before + at));
        const number counted = change < NOWHERE ? change : (number)NOWHERE;
        largest = most(choose(light == light, counted, 0), largest);
    }
    changes[row] = largest_of_lanes(largest);
}
