/* Between two levels of the multigrid method: values, viscosity and the residual of the equation go to the next coarser
 * level, corrections and first values come back.
 *
 * An axis of n cells has n / 2 + 1 on the coarser level, with the ends of both at the same places, so that the spacing
 * grows by no more than 2. Values are interpolated between the two nearest cells along each axis, and so are they on the
 * way to the coarser level; the residual goes there by the transpose of the interpolation. Of all these only cells that
 * are solved, or solved or known, count, and their shares add up to 1.
 *
 * The viscosity of the coarser level keeps sigma times the spacing, as the equation does, but is no less than
 * MARGIN |dH/dp|, which keeps the scheme monotone around the values that it begins with, nor more than the model's own
 * bound for that.
 *
 * Functions of one cell, and kernels in which a work-item takes one, with LANES 1: global size (at least width, height),
 * of the level that is written.
 */
#define MARGIN 1.125f

/* A table of the columns or rows of a level: its planes, and how long they are. */
typedef struct {
    __global const real *numbers;
    __global const int *steps;
    int length;
} axis_tables;

static inline axis_tables columns_of(__global const real *axes, __global const int *steps, const grid_level here)
{
    const axis_tables result = {axes + AXIS_PLANES * here.columns, steps + STEP_PLANES * here.columns, here.stride};
    return result;
}

static inline axis_tables rows_of(__global const real *axes, __global const int *steps, const grid_level here)
{
    const axis_tables result = {axes + AXIS_PLANES * here.rows, steps + STEP_PLANES * here.rows, here.height + 1};
    return result;
}

/* Where the cell lies between two coarse cells, and between two fine ones: the first of them, and the other's share. */
static inline int coarse_of(const axis_tables tables, const int index, real *share)
{
    *share = tables.numbers[3 * tables.length + index];
    return tables.steps[index];
}

static inline int fine_of(const axis_tables tables, const int index, real *share)
{
    *share = tables.numbers[4 * tables.length + index];
    return tables.steps[tables.length + index];
}

/* Share of one of four cells, by its number from left to right and down. */
static inline real share_of(const int corner, const real share_x, const real share_y)
{
    return (corner & 1 ? share_x : 1 - share_x) * (corner >> 1 ? share_y : 1 - share_y);
}

/* Values between four cells, of which those that are at least `least_kind` and at most `most_kind` count. */
static inline real between(__global const real *values, __global const uchar *kinds, const int stride,
                           const real share_x, const real share_y, const int least_kind, const int most_kind)
{
    real sum = 0, shares = 0;
    for (int corner = 0; corner < 4; ++corner) {
        const int at = (corner >> 1) * stride + (corner & 1);
        const real share = share_of(corner, share_x, share_y);
        /* A share of 0 may belong to a cell that is not there. */
        if (share > 0 && kinds[at] >= least_kind && kinds[at] <= most_kind) {
            sum += share * values[at];
            shares += share;
        }
    }
    return shares > 0 ? sum / shares : 0;
}

/* The transpose of the interpolation, of solved cells. */
static inline real gathered(__global const real *fine_values, __global const uchar *kinds, const grid_level fine,
                            const axis_tables fine_columns, const axis_tables fine_rows, const int column,
                            const int row, const int first_column, const int first_row)
{
    real sum = 0, shares = 0;
    for (int fine_row = first_row; fine_row < fine.height; ++fine_row) {
        real after_y;
        const int above = coarse_of(fine_rows, fine_row, &after_y);
        if (above > row)
            break;
        const real share_y = above == row ? 1 - after_y : after_y;
        for (int fine_column = first_column; fine_column < fine.width; ++fine_column) {
            real after_x;
            const int before = coarse_of(fine_columns, fine_column, &after_x);
            if (before > column)
                break;
            const size_t at = place_of(fine, fine_column, fine_row);
            const real share = share_y * (before == column ? 1 - after_x : after_x);
            if (kinds[at] == SOLVED) {
                sum += share * fine_values[at];
                shares += share;
            }
        }
    }
    return shares > 0 ? sum / shares : 0;
}

/* Brightness of a solved cell of the coarser level, and value of a known one: that between known cells, if one of these
 * is next to it, else the mean of those that it is nearest to.
 */
static inline void coarsen_cell(__global real *values, __global real *brightness, __global const uchar *kinds,
                                __global const real *axes, __global const int *steps, const grid_level fine,
                                const grid_level coarse, const int column, const int row)
{
    const axis_tables columns = columns_of(axes, steps, coarse), rows = rows_of(axes, steps, coarse);
    const size_t here = place_of(coarse, column, row);
    const int kind = kinds[here];
    real light = NAN, value = 0;
    if (kind == SOLVED)
        light = gathered(brightness, kinds, fine, columns_of(axes, steps, fine), rows_of(axes, steps, fine), column,
                         row, columns.steps[2 * columns.length + column], rows.steps[2 * rows.length + row]);
    if (kind == KNOWN) {
        real share_x, share_y, sum = 0;
        const int left = fine_of(columns, column, &share_x), up = fine_of(rows, row, &share_y);
        const size_t corner = place_of(fine, left, up);
        int count = 0, is_between = 0;
        for (int at = 0; at < 4; ++at)
            is_between |= kinds[corner + (size_t)((at >> 1) * fine.stride + (at & 1))] == KNOWN &&
                          share_of(at, share_x, share_y) > 0;
        if (is_between) {
            value = between(values + corner, kinds + corner, fine.stride, share_x, share_y, KNOWN, KNOWN);
        } else {
            __global const int *cells_x = columns.steps + 3 * columns.length, *cells_y = rows.steps + 3 * rows.length;
            for (int i = cells_y[row]; i < cells_y[row + 1]; ++i)
                for (int j = cells_x[column]; j < cells_x[column + 1]; ++j)
                    if (kinds[place_of(fine, j, i)] == KNOWN) {
                        sum += values[place_of(fine, j, i)];
                        ++count;
                    }
            value = sum / count;
        }
    }
    brightness[here] = light;
    values[here] = value;
}

/* The model's own viscosity. */
static inline void own_weights_of_cell(__global real *weights_x, __global real *weights_y,
                                       __global const real *brightness, __global const real *axes,
                                       __global const int *steps, const grid_level here,
                                       const parameter_set *parameters, const int column, const int row)
{
    const axis_tables columns = columns_of(axes, steps, here), rows = rows_of(axes, steps, here);
    const axis x = axis_at(columns.numbers, columns.length, column), y = axis_at(rows.numbers, rows.length, row);
    const size_t at = place_of(here, column, row);
    weights_x[at] = viscosity(brightness[at], x, y, parameters);
    weights_y[at] = viscosity(brightness[at], y, x, parameters);
}

/* Of the finer level: values, to begin with and to compare with; viscosity at the same sigma times the spacing; and the
 * residual of the equation.
 */
static inline void restrict_cell(__global const real *fine_values, __global const real *residual,
                                 __global real *values, __global real *before, __global real *source,
                                 __global real *weights_x, __global real *weights_y, __global const uchar *kinds,
                                 __global const real *axes, __global const int *steps, const grid_level fine,
                                 const grid_level coarse, const parameter_set *fine_parameters,
                                 const parameter_set *parameters, const int column, const int row)
{
    const axis_tables columns = columns_of(axes, steps, coarse), rows = rows_of(axes, steps, coarse);
    const size_t here = place_of(coarse, column, row);
    const int kind = kinds[here];
    if (kind == ABSENT)
        return;
    real share_x, share_y;
    const int left = fine_of(columns, column, &share_x), up = fine_of(rows, row, &share_y);
    const size_t corner = place_of(fine, left, up);
    values[here] = before[here] =
        between(fine_values + corner, kinds + corner, fine.stride, share_x, share_y, SOLVED, KNOWN);
    if (kind != SOLVED)
        return;
    const real ratio_x = parameters->half_inverse_dx / fine_parameters->half_inverse_dx;
    const real ratio_y = parameters->half_inverse_dy / fine_parameters->half_inverse_dy;
    weights_x[here] = ratio_x * ratio_x *
                      between(weights_x + corner, kinds + corner, fine.stride, share_x, share_y, SOLVED, SOLVED);
    weights_y[here] = ratio_y * ratio_y *
                      between(weights_y + corner, kinds + corner, fine.stride, share_x, share_y, SOLVED, SOLVED);
    source[here] = gathered(residual, kinds, fine, columns_of(axes, steps, fine), rows_of(axes, steps, fine), column,
                            row, columns.steps[2 * columns.length + column], rows.steps[2 * rows.length + row]);
}

/* The equation of the coarser level for the values that it begins with: its viscosity, and f, of which N(W) is a part. */
static inline void freeze_cell(__global const real *values, __global real *source, __global real *weights_x,
                               __global real *weights_y, __global const real *brightness, __global const real *axes,
                               __global const int *steps, const grid_level here, const parameter_set *parameters,
                               const int column, const int row)
{
    const axis_tables columns = columns_of(axes, steps, here), rows = rows_of(axes, steps, here);
    const size_t at = place_of(here, column, row);
    const real light = brightness[at];
    if (light != light)
        return;
    const axis x = axis_at(columns.numbers, columns.length, column), y = axis_at(rows.numbers, rows.length, row);
    __global const real *cell = values + at;
    const real to_p = parameters->sign * parameters->half_inverse_dx;
    const real to_q = parameters->sign * parameters->half_inverse_dy;
    const real p = (cell[1] - cell[-1]) * to_p, q = (cell[here.stride] - cell[-here.stride]) * to_q;
    const real slope_x = hamiltonian_slope(light, p, q, x.coordinate, y.coordinate, 0, parameters);
    const real slope_y = hamiltonian_slope(light, p, q, x.coordinate, y.coordinate, 1, parameters);
    const real needed_x = MARGIN * fabs(slope_x) * parameters->half_inverse_dx;
    const real needed_y = MARGIN * fabs(slope_y) * parameters->half_inverse_dy;
    const real weight_x = most(least(needed_x, viscosity(light, x, y, parameters)), weights_x[at]);
    const real weight_y = most(least(needed_y, viscosity(light, y, x, parameters)), weights_y[at]);
    weights_x[at] = weight_x;
    weights_y[at] = weight_y;
    source[at] += operator_at(cell, here.stride, light, weight_x, weight_y, x.coordinate, y.coordinate, parameters);
}

/* Of a solved cell: its value and how far the coarser level has moved around it. */
static inline void correct_cell(__global const real *uncorrected, __global real *corrected,
                                __global const real *values, __global const real *before, __global const uchar *kinds,
                                __global const real *axes, __global const int *steps, const grid_level fine,
                                const grid_level coarse, const int column, const int row)
{
    const size_t at = place_of(fine, column, row);
    real change = 0;
    if (kinds[at] == SOLVED) {
        real share_x, share_y;
        const int left = coarse_of(columns_of(axes, steps, fine), column, &share_x);
        const int up = coarse_of(rows_of(axes, steps, fine), row, &share_y);
        const size_t corner = place_of(coarse, left, up);
        real sum = 0, shares = 0;
        for (int place = 0; place < 4; ++place) {
            const size_t from = corner + (size_t)((place >> 1) * coarse.stride + (place & 1));
            const real share = share_of(place, share_x, share_y);
            if (share > 0 && kinds[from] != ABSENT) {
                sum += share * (values[from] - before[from]);
                shares += share;
            }
        }
        change = shares > 0 ? sum / shares : 0;
    }
    corrected[at] = uncorrected[at] + change;
}

/* First values of solved cells, from the coarser level. */
static inline void interpolate_cell(__global real *values, __global const uchar *kinds, __global const real *axes,
                                    __global const int *steps, const grid_level fine, const grid_level coarse,
                                    const int column, const int row)
{
    const size_t at = place_of(fine, column, row);
    if (kinds[at] != SOLVED)
        return;
    real share_x, share_y;
    const int left = coarse_of(columns_of(axes, steps, fine), column, &share_x);
    const int up = coarse_of(rows_of(axes, steps, fine), row, &share_y);
    const size_t corner = place_of(coarse, left, up);
    values[at] = between(values + corner, kinds + corner, coarse.stride, share_x, share_y, SOLVED, KNOWN);
}

/* The kernels: `level` is that which is written. */
__kernel void coarsen(__global real *values,          /* W; of known cells of the level a result */
                      __global real *brightness,      /* of the level a result                   */
                      __global const uchar *kinds,    /* ABSENT, SOLVED or KNOWN                 */
                      __global const real *axes,
                      __global const int *steps,
                      __global const int *levels,
                      const int level)
{
    const grid_level here = level_at(levels, level);
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column < here.width)
        coarsen_cell(values, brightness, kinds, axes, steps, level_at(levels, level - 1), here, column, row);
}

__kernel void take_own_weights(__global real *weights_x, /* results */
                               __global real *weights_y,
                               __global const real *brightness,
                               __global const real *axes,
                               __global const int *steps,
                               __global const int *levels,
                               __global const parameter_set *parameters,
                               const int level)
{
    const grid_level here = level_at(levels, level);
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    const parameter_set own = parameters[level];
    if (column < here.width)
        own_weights_of_cell(weights_x, weights_y, brightness, axes, steps, here, &own, column, row);
}

__kernel void restrict_level(__global const real *fine_values, /* W of the finer level         */
                             __global const real *residual,   /* of the finer level           */
                             __global real *values,            /* results                      */
                             __global real *before,
                             __global real *source,
                             __global real *weights_x,
                             __global real *weights_y,
                             __global const uchar *kinds,
                             __global const real *axes,
                             __global const int *steps,
                             __global const int *levels,
                             __global const parameter_set *parameters,
                             const int level)
{
    const grid_level here = level_at(levels, level);
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    const parameter_set finer = parameters[level - 1], own = parameters[level];
    if (column < here.width)
        restrict_cell(fine_values, residual, values, before, source, weights_x, weights_y, kinds, axes, steps,
                      level_at(levels, level - 1), here, &finer, &own, column, row);
}

__kernel void freeze_level(__global const real *values,
                           __global real *source,    /* results, of what restrict_level has left */
                           __global real *weights_x,
                           __global real *weights_y,
                           __global const real *brightness,
                           __global const real *axes,
                           __global const int *steps,
                           __global const int *levels,
                           __global const parameter_set *parameters,
                           const int level)
{
    const grid_level here = level_at(levels, level);
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    const parameter_set own = parameters[level];
    if (column < here.width)
        freeze_cell(values, source, weights_x, weights_y, brightness, axes, steps, here, &own, column, row);
}

__kernel void correct_level(__global const real *uncorrected, /* W of the level                   */
                            __global real *corrected,         /* result, may be the same array    */
                            __global const real *values,      /* of the coarser level             */
                            __global const real *before,      /* what these were to begin with    */
                            __global const uchar *kinds,
                            __global const real *axes,
                            __global const int *steps,
                            __global const int *levels,
                            const int level)
{
    const grid_level here = level_at(levels, level);
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column < here.width)
        correct_cell(uncorrected, corrected, values, before, kinds, axes, steps, here, level_at(levels, level + 1),
                     column, row);
}

__kernel void interpolate_level(__global real *values, /* W: a result where solved */
                                __global const uchar *kinds,
                                __global const real *axes,
                                __global const int *steps,
                                __global const int *levels,
                                const int level)
{
    const grid_level here = level_at(levels, level);
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    if (column < here.width)
        interpolate_cell(values, kinds, axes, steps, here, level_at(levels, level + 1), column, row);
}
