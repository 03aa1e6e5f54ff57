/* One sweep in the paper's order, a double loop over rows and columns: the reference for the other orderings.
 *
 * One work-item takes an image: global size (images,). Reads and writes log_depth in place.
 */
__kernel void sweep(__global real *log_depth,          /* shape (images, rows, stride)                        */
                    __global const real *brightness,   /* E, marked as in update.cl, same shape               */
                    __global const real *limits,       /* as many as LIMITS says, of that shape each          */
                    __global const uchar *flags,       /* same shape                                          */
                    __global const parameter_set *parameters, /* shape (images,)                                     */
                    __global const real *column_table, /* shape (images, 3, stride)                           */
                    __global const real *row_table,    /* shape (images, 3, rows)                             */
                    __global const float *changes,     /* see prelude                                         */
                    const int iteration,               /* index into changes                                  */
                    const float tolerance,             /* on max |dZ|                                         */
                    const int images,                  /* of this run                                         */
                    const int rows,                    /* stored rows, padding included                       */
                    const int stride,                  /* stored columns, padding included                    */
                    const int first_row,               /* of the image within its padding                     */
                    const int first_column,            /* likewise                                            */
                    const int height,                  /* pixels                                              */
                    const int width,                   /* pixels                                              */
                    const int leftwards,               /* 1: columns from the right                           */
                    const int upwards)                 /* 1: rows from the bottom                             */
{
    const int image = (int)get_global_id(0);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    const parameter_set numbers = parameters[image];
    const bounds within = bounds_from(limits, (size_t)images * (size_t)rows * (size_t)stride, 0);
    const size_t begin = (size_t)image * (size_t)rows * (size_t)stride;
    for (int i = 0; i < height; ++i)
        for (int j = 0; j < width; ++j) {
            const int row = first_row + (upwards ? height - 1 - i : i);
            const int column = first_column + (leftwards ? width - 1 - j : j);
            const size_t cell = begin + (size_t)row * (size_t)stride + (size_t)column;
            update_cell(log_depth, brightness, within, flags, cell, stride, leftwards, upwards,
                        axis_at(column_table + image * 3 * stride, stride, column),
                        axis_at(row_table + image * 3 * rows, rows, row), &numbers);
        }
}
