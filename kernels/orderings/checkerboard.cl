/* Half a sweep: all cells of one colour, which is the parity of row + column. Two launches visit every cell once.
 *
 * The iterates are not those of the lexicographic order, but the fixed point is that of a monotone scheme, and Z never
 * increases. The work-items of a row share its vectors of LANES cells: global size (items, rows - 2, images). Reads and
 * writes log_depth in place.
 */
__kernel void sweep(__global real *log_depth,          /* shape (images, rows, stride), columns apart         */
                    __global const real *brightness,   /* E, marked as in update.cl, same shape               */
                    __global const real *limits,       /* as many as LIMITS says, of that shape each          */
                    __global const uchar *flags,       /* same shape                                          */
                    __global const parameter_set *parameters, /* shape (images,)                                     */
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
    const parameter_set numbers = parameters[image];
    const size_t size = (size_t)rows * (size_t)stride, begin = (size_t)image * size;
    const bounds within = bounds_from(limits, (size_t)images * size, begin);
    update_colour(log_depth + begin, brightness + begin, within, flags + begin, &numbers,
                  column_table + image * 3 * stride, row_table + image * 3 * rows, rows, stride,
                  1 + (int)get_global_id(1), colour, (int)get_global_id(0), vectors_of(stride),
                  (int)get_global_size(0));
}
