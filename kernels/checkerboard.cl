/* Half a sweep: all cells of one colour, which read only cells of the other. Two launches visit every cell once.
 *
 * Not the iterates of the lexicographic order, but the same fixed point, and Z still never increases. One work-item
 * takes one cell: global size (ceil(width / 2), height). Reads and writes log_depth in place.
 */
__kernel void sweep(__global real *log_depth,          /* shape (height, width)                     */
                    __global const real *brightness,   /* shape (height, width)                     */
                    __global const uchar *flags,       /* shape (height, width)                     */
                    __constant const real *parameters, /* see prelude and model                     */
                    const int width,                   /* pixels                                    */
                    const int height,                  /* pixels                                    */
                    const int colour)                  /* parity of row + column of the cells       */
{
    const int row = (int)get_global_id(1);
    const int column = 2 * (int)get_global_id(0) + ((row + colour) & 1);
    if (row < height && column < width)
        update_cell(log_depth, brightness, flags, parameters, width, column, row);
}
