/* Half a sweep: all cells of one colour, which read only cells of the other. Two launches visit every cell once.
 *
 * Not the iterates of the lexicographic order, but the same fixed point, and Z still never increases. The columns are
 * stored apart, the even ones before the odd ones, so that the cells of one colour of a row lie side by side: half the
 * memory traffic, and whole vectors. Left and right neighbours are in the other half of the row.
 *
 * One work-item updates LANES cells: global size (half stride / LANES, rows - 2, images). In place.
 */
__kernel void sweep(__global real *log_depth,          /* shape (images, rows, stride), columns apart         */
                    __global const real *brightness,   /* E, marked as in cell.cl, same shape                 */
                    __global const uchar *flags,       /* same shape                                          */
                    __global const real *parameters,   /* shape (images, PARAMETERS)                          */
                    __global const real *column_table, /* shape (images, 3, stride), columns apart            */
                    __global const real *row_table,    /* shape (images, 3, rows)                             */
                    __global const float *changes,     /* see prelude                                         */
                    const int iteration,               /* index into changes                                  */
                    const float tolerance,             /* on max |dZ|                                         */
                    const int rows,                    /* stored rows, padding included                       */
                    const int stride,                  /* stored columns, padding included                    */
                    const int colour)                  /* parity of stored row + column of the cells          */
{
    const int image = (int)get_global_id(2);
    if (finished(changes, iteration, image, (int)get_global_size(2), tolerance))
        return;
    const int row = 1 + (int)get_global_id(1);
    const int half_stride = stride / 2;
    const int odd = (row + colour) & 1; /* these cells stand in the odd columns of their row */
    const int first = LANES * (int)get_global_id(0);
    const long cell = ((long)image * rows + row) * stride + odd * half_stride + first;
    const long left = odd ? cell - half_stride : cell + half_stride - 1;

    const number shading = LOAD(brightness + cell);
    const number here = LOAD(log_depth + cell);
    const number before = LOAD(log_depth + left), after = LOAD(log_depth + left + 1);
    const number up = LOAD(log_depth + cell - stride), down = LOAD(log_depth + cell + stride);

    real numbers[PARAMETERS];
    copy_parameters(numbers, parameters, image);
    __global const real *columns = column_table + image * 3 * stride + odd * half_stride + first;
    __global const real *line = row_table + image * 3 * rows + row;
    const axis x = {LOAD(columns), LOAD(columns + stride), LOAD(columns + 2 * stride)};
    const axis y = {(number)line[0], (number)line[rows], (number)line[2 * rows]};

    number value = inner_value(shading, before, after, up, down, numbers[SURFACE_SIGN] * numbers[HALF_INVERSE_DX],
                               numbers[SURFACE_SIGN] * numbers[HALF_INVERSE_DY], x, y, numbers);
    const integer on_rim = as_integer(shading) < 0;
    if (any_sign(as_integer(shading))) {
        const number rim =
            rim_value(magnitude(shading), LOAD_FLAGS(flags + cell), here, before, after, up, down, x, y, numbers);
        value = on_rim ? rim : value;
    }
    STORE(log_depth + cell, value < here ? value : here);
}
