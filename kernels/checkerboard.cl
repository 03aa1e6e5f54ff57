/* Half a sweep: all cells of one colour, which read only cells of the other. Two launches visit every cell once.
 *
 * Not the iterates of the lexicographic order, but the same fixed point, and Z still never increases. The columns are
 * stored apart, the even ones before the odd ones, so that the cells of one colour of a row lie side by side: half the
 * memory traffic, and whole vectors. Left and right neighbours are in the other half of the row.
 *
 * One work-item takes vectors of LANES cells of a row: global size (items, rows - 2, images), with one
 * item on a CPU and one for each vector on a GPU. In place.
 */
#define GAP (LANES > 4 ? LANES : 4) /* columns at the end of each half that are never written */

/* No neighbour comes before the others here: a scheme that has directions looks in all four. */
static inline number value_from_all_sides(const number brightness, const number here, const number left,
                                          const number right, const number up, const number down, const real to_p, const real to_q,
                                          const axis x, const axis y, const real *parameters)
{
#if DIRECTED
    return least(least(inner_value(brightness, here, left, right, up, down, to_p, to_q, x, y, parameters),
                       inner_value(brightness, here, right, left, up, down, -to_p, to_q, x, y, parameters)),
                 least(inner_value(brightness, here, left, right, down, up, to_p, -to_q, x, y, parameters),
                       inner_value(brightness, here, right, left, down, up, -to_p, -to_q, x, y, parameters)));
#else
    return inner_value(brightness, here, left, right, up, down, to_p, to_q, x, y, parameters);
#endif
}

__kernel void sweep(__global real *log_depth,          /* shape (images, rows, stride), columns apart         */
                    __global const real *brightness,   /* E, marked as in cell.cl, same shape                 */
                    __global const uchar *flags,       /* same shape                                          */
                    __global const real *parameters,   /* shape (images, PARAMETERS)                          */
                    __global const real *column_table, /* shape (images, 3, stride), columns apart            */
                    __global const real *row_table,    /* shape (images, 3, rows)                             */
                    __global const float *changes,     /* see prelude                                         */
                    const int iteration,               /* index into changes                                  */
                    const float tolerance,             /* on max |dZ|                                         */
                    const int images,                  /* of this run                                         */
                    const int rows,                    /* stored rows, padding included                       */
                    const int stride,                  /* stored columns, padding included                    */
                    const int colour)                  /* parity of stored row + column of the cells          */
{
    const int image = (int)get_global_id(2);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    const int row = 1 + (int)get_global_id(1);
    const int half_stride = stride / 2;
    const int odd = (row + colour) & 1; /* these cells stand in the odd columns of their row */
    const long line = ((long)image * rows + row) * stride;
    const int to_left = odd ? -half_stride : half_stride - 1;
    __global real *cells = log_depth + line + odd * half_stride;
    __global const real *shadings = brightness + line + odd * half_stride;
    __global const real *columns = column_table + image * 3 * stride + odd * half_stride;
    __global const real *row_numbers = row_table + image * 3 * rows + row;
    const axis y = {(number)row_numbers[0], (number)row_numbers[rows], (number)row_numbers[2 * rows]};
    real numbers[PARAMETERS];
    copy_parameters(numbers, parameters, image);
    const real to_p = numbers[SURFACE_SIGN] * numbers[HALF_INVERSE_DX];
    const real to_q = numbers[SURFACE_SIGN] * numbers[HALF_INVERSE_DY];

    const int step = LANES * (int)get_global_size(0);
    for (int first = LANES * (int)get_global_id(0); first < half_stride - GAP; first += step) {
        __global real *cell = cells + first;
        const number shading = LOAD(shadings + first);
        const number here = LOAD(cell);
        const number left = LOAD(cell + to_left), right = LOAD(cell + to_left + 1);
        const number up = LOAD(cell - stride), down = LOAD(cell + stride);
        const axis x = {LOAD(columns + first), LOAD(columns + first + stride), LOAD(columns + first + 2 * stride)};

        number value = value_from_all_sides(shading, here, left, right, up, down, to_p, to_q, x, y, numbers);
#if RIM_CELLS
        if (any_sign(as_integer(shading))) {
            const integer missing = LOAD_FLAGS(flags + line + odd * half_stride + first);
            const number rim = rim_value(magnitude(shading), missing, here, left, right, up, down, x, y, numbers);
            value = as_integer(shading) < 0 ? rim : value;
        }
#endif
        STORE(cell, value < here ? value : here);
    }
}
