/* All levels of the multigrid method that are small, in one launch: one for each step would take longer than its work.
 *
 * One work-group does all of it. Its work-items take cells in turn, and wait for each other after each step; the cells
 * of a colour do not read each other, so that values are relaxed where they lie. LANES is 1.
 *
 * ALONE  1: the group has one work-item, and nobody to wait for. On processors PoCL cannot compile as many barriers in
 *        loops. 0 for others: Mesa's compilers go wrong where one work-item reads again what it has written.
 * HALF_SWEEPS  of an iteration.
 */
#if ALONE
#define FOR_EACH_CELL(here) for (int cell = 0; cell < (here).width * (here).height; ++cell)
#define WAIT()
#else
#define FOR_EACH_CELL(here)                                                                                            \
    for (int cell = (int)get_local_id(0); cell < (here).width * (here).height; cell += (int)get_local_size(0))
#define WAIT() barrier(CLK_GLOBAL_MEM_FENCE)
#endif
#define COLUMN_OF(here) (cell % (here).width)
#define ROW_OF(here) (cell / (here).width)

/* The arrays of all levels. */
typedef struct {
    __global real *values, *residual, *before, *source, *weights_x, *weights_y;
    __global const real *brightness;
    __global const uchar *kinds;
    __global const real *axes;
    __global const int *steps, *levels;
    __global const parameter_set *parameters;
} hierarchy;

static inline void relax_small(const hierarchy all, const int level, const int with_source, const int iterations)
{
    const grid_level here = level_at(all.levels, level);
    const parameter_set own = all.parameters[level];
    const axis_tables columns = columns_of(all.axes, all.steps, here), rows = rows_of(all.axes, all.steps, here);
    for (int sweep = 0; sweep < HALF_SWEEPS * iterations; ++sweep) {
        FOR_EACH_CELL(here)
        {
            const int column = COLUMN_OF(here), row = ROW_OF(here);
            const size_t at = place_of(here, column, row);
            const real light = all.brightness[at];
            if (((row + column + sweep) & 1) == 0 && light == light)
                all.values[at] =
                    relaxed_value(all.values + at, here.stride, light, all.weights_x[at], all.weights_y[at],
                                  with_source ? all.source[at] : 0, columns.numbers[column], rows.numbers[row], &own);
        }
        WAIT();
    }
}

/* To the next coarser level. */
static inline void descend(const hierarchy all, const int level, const int with_source)
{
    const grid_level here = level_at(all.levels, level), coarse = level_at(all.levels, level + 1);
    const parameter_set own = all.parameters[level], coarser = all.parameters[level + 1];
    const axis_tables columns = columns_of(all.axes, all.steps, here), rows = rows_of(all.axes, all.steps, here);
    FOR_EACH_CELL(here)
    {
        const int column = COLUMN_OF(here), row = ROW_OF(here);
        const size_t at = place_of(here, column, row);
        const real light = all.brightness[at];
        if (light == light)
            all.residual[at] =
                residual_at(all.values + at, here.stride, light, all.weights_x[at], all.weights_y[at],
                            with_source ? all.source[at] : 0, columns.numbers[column], rows.numbers[row], &own);
    }
    WAIT();
    FOR_EACH_CELL(coarse)
    restrict_cell(all.values, all.residual, all.values, all.before, all.source, all.weights_x, all.weights_y,
                  all.kinds, all.axes, all.steps, here, coarse, &own, &coarser, COLUMN_OF(coarse), ROW_OF(coarse));
    WAIT();
    FOR_EACH_CELL(coarse)
    freeze_cell(all.values, all.source, all.weights_x, all.weights_y, all.brightness, all.axes, all.steps, coarse,
                &coarser, COLUMN_OF(coarse), ROW_OF(coarse));
    WAIT();
}

/* A cycle down to the coarsest level and back. */
static inline void cycle_from(const hierarchy all, const int first, const int last, const int with_source,
                              const int coarsest_iterations)
{
    for (int level = first; level < last; ++level) {
        const int has_source = with_source || level > first;
        relax_small(all, level, has_source, 1);
        descend(all, level, has_source);
    }
    relax_small(all, last, with_source || last > first, coarsest_iterations);
    for (int level = last - 1; level >= first; --level) {
        const grid_level here = level_at(all.levels, level), coarse = level_at(all.levels, level + 1);
        FOR_EACH_CELL(here)
        correct_cell(all.values, all.values, all.values, all.before, all.kinds, all.axes, all.steps, here, coarse,
                     COLUMN_OF(here), ROW_OF(here));
        WAIT();
        relax_small(all, level, with_source || level > first, 1);
    }
}

/* The cycle of the levels `first` to `last`, for the f of the first. */
__kernel void cycle_small_levels(__global real *values,    /* W, result                    */
                                 __global real *residual,  /* this and the following: room */
                                 __global real *before,
                                 __global real *source,    /* f                            */
                                 __global real *weights_x,
                                 __global real *weights_y,
                                 __global const real *brightness,
                                 __global const uchar *kinds,
                                 __global const real *axes,
                                 __global const int *steps,
                                 __global const int *levels,
                                 __global const parameter_set *parameters,
                                 const int first,
                                 const int last,
                                 const int coarsest_iterations)
{
    const hierarchy all = {values,     residual, before, source, weights_x, weights_y,
                           brightness, kinds,    axes,   steps,  levels,    parameters};
    cycle_from(all, first, last, 1, coarsest_iterations);
}

/* The surface on the level `first`: on the coarsest by iterations from `above` alone, on each finer one by cycles from
 * what the one before has come to.
 */
__kernel void solve_small_levels(__global real *values, /* W, of known cells given; result */
                                 __global real *residual,
                                 __global real *before,
                                 __global real *source,
                                 __global real *weights_x,
                                 __global real *weights_y,
                                 __global const real *brightness,
                                 __global const uchar *kinds,
                                 __global const real *axes,
                                 __global const int *steps,
                                 __global const int *levels,
                                 __global const parameter_set *parameters,
                                 const int first,
                                 const int last,
                                 const int coarsest_iterations, /* of a cycle                    */
                                 const int first_iterations,    /* of the coarsest level, alone  */
                                 const int cycles,              /* of each level                 */
                                 const real above)
{
    const hierarchy all = {values,     residual, before, source, weights_x, weights_y,
                           brightness, kinds,    axes,   steps,  levels,    parameters};
    for (int level = last; level >= first; --level) {
        const grid_level here = level_at(levels, level), coarse = level_at(levels, min(level + 1, last));
        const parameter_set own = parameters[level];
        FOR_EACH_CELL(here)
        {
            const int column = COLUMN_OF(here), row = ROW_OF(here);
            own_weights_of_cell(weights_x, weights_y, brightness, axes, steps, here, &own, column, row);
            if (level < last)
                interpolate_cell(values, kinds, axes, steps, here, coarse, column, row);
            else if (kinds[place_of(here, column, row)] == SOLVED)
                values[place_of(here, column, row)] = above;
        }
        WAIT();
        if (level == last)
            relax_small(all, level, 0, first_iterations);
        else
            for (int cycle = 0; cycle < cycles; ++cycle)
                cycle_from(all, level, last, 0, coarsest_iterations);
    }
}
