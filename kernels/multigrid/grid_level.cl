/* One level of a multigrid method for the scheme's equation on a hierarchy of grids. On a level that is
 *
 *     N(W) = f,    N(W) = s (W - value(W)),    s = 2 (sigma_x / (2 dx) + sigma_y / (2 dy)) + dH/dZ
 *
 * with the value that the scheme gives a cell, f = 0 on the finest level, and a viscosity of its own for every cell: the
 * `weights`, sigma / (2 spacing), in place of those that the model has.
 *
 * All levels lie in one array, from fine to coarse, with a border of a cell at least around each, which may be read but
 * plays no part: every solved cell has all its neighbours. So do the arrays of the other quantities. The brightness is
 * NaN where a cell is not solved; the value of such a cell comes out as NaN, and is not taken.
 *
 * `levels` has LEVEL_NUMBERS integers for each level: where its first cell lies, width, height, the stride of its rows,
 * and where its numbers of columns and rows begin in the tables. Of these `axes` has as many planes as AXIS_PLANES says,
 * and `steps` as STEP_PLANES; a plane of columns is as long as a row is apart from the next, one of rows as the height
 * and one more:
 *
 *     axes   coordinate, root and offset as in `axis` of prelude.cl; toward the next coarser level, the share of the
 *            second of two coarse cells between which the cell lies; from the finer level, the share of the second of
 *            the two fine cells between which it lies
 *     steps  the first of those two coarse cells; the first of those two fine cells; the first fine cell that is
 *            interpolated from this one; the first fine cell that is nearest to this one
 *
 * A cell is ABSENT, SOLVED or KNOWN; these numbers, AXIS_PLANES and STEP_PLANES are given to the program.
 *
 * Functions for the lanes of one vector, in a program with a model and a scheme. They read no memory but the cells that
 * pointers lead to.
 */
#define LEVEL_NUMBERS 6

typedef struct {
    int begin, width, height, stride, columns, rows;
} grid_level;

static inline grid_level level_at(__global const int *levels, const int level)
{
    __global const int *own = levels + LEVEL_NUMBERS * level;
    const grid_level result = {own[0], own[1], own[2], own[3], own[4], own[5]};
    return result;
}

/* Place of a cell in the arrays of all levels. */
static inline size_t place_of(const grid_level here, const int column, const int row)
{
    return (size_t)here.begin + (size_t)row * (size_t)here.stride + (size_t)column;
}

/* s, from the weights of a cell. */
static inline number scale_of(const number weight_x, const number weight_y)
{
    return 2 * (weight_x + weight_y) + DH_DZ;
}

/* What the scheme gives cells whose first value is at `cell`, with weights of their own: the model multiplies a root by
 * the brightness and adds an offset.
 */
static inline number value_with(__global const real *cell, const int stride, const number brightness,
                                const number weight_x, const number weight_y, const number x, const number y,
                                const parameter_set *parameters)
{
    const number none = 0;
    const axis along_x = {x, none, weight_x}, along_y = {y, none, weight_y};
    const real sign = parameters->sign;
    return inner_value(brightness, LOAD(cell), LOAD(cell - 1), LOAD(cell + 1), LOAD(cell - stride),
                       LOAD(cell + stride), sign * parameters->half_inverse_dx, sign * parameters->half_inverse_dy,
                       along_x, along_y, parameters);
}

/* N(W) */
static inline number operator_at(__global const real *cell, const int stride, const number brightness,
                                 const number weight_x, const number weight_y, const number x, const number y,
                                 const parameter_set *parameters)
{
    const number value = value_with(cell, stride, brightness, weight_x, weight_y, x, y, parameters);
    return scale_of(weight_x, weight_y) * (LOAD(cell) - value);
}

/* The values that solve the equation at cells for the neighbours that they have; what they are where not solved. */
static inline number relaxed_value(__global const real *cell, const int stride, const number brightness,
                                   const number weight_x, const number weight_y, const number source, const number x,
                                   const number y, const parameter_set *parameters)
{
    const number value = value_with(cell, stride, brightness, weight_x, weight_y, x, y, parameters);
    const number next = value + source / scale_of(weight_x, weight_y);
    return brightness == brightness ? next : LOAD(cell);
}

/* f - N(W), 0 where not solved. */
static inline number residual_at(__global const real *cell, const int stride, const number brightness,
                                 const number weight_x, const number weight_y, const number source, const number x,
                                 const number y, const parameter_set *parameters)
{
    const number found = source - operator_at(cell, stride, brightness, weight_x, weight_y, x, y, parameters);
    return choose(brightness == brightness, found, 0);
}
