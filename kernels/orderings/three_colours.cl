/* A third of a sweep: all cells of one colour, which is (row + column) modulo 3. With second-order differences a cell
 * reads two neighbours on every side, none of which has its colour. Three launches visit every cell once.
 *
 * One work-item takes one cell, and updates it if it has the colour: global size (width or more, height,
 * images). Reads and writes log_depth in place.
 *
 * With RESTS a group, which takes PART of a row, is left alone if neither it nor what it reads has changed since this
 * colour had its turn, three thirds of a sweep ago: see account.cl. These count from FIRST_THIRD; before it a part has
 * FIRST_THIRD - 1, or 0 where there is nothing to sweep. What others change meanwhile, in this group or in another,
 * does not matter: it has the same colour, and an item that goes on because of it finds the same value again.
 */
#define FIRST_THIRD 4

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
                    const int colour,                  /* 0 to 2                                              */
                    __global volatile int *changed,    /* shape (images, height + 4, parts + 4)               */
                    const int thirds_before)           /* of this run                                         */
{
    const int image = (int)get_global_id(2), row = (int)get_global_id(1), column = (int)get_global_id(0);
    if (row >= height || column >= width || (row + column) % 3 != colour ||
        finished(changes, iteration, image, images, tolerance))
        return;
    const int third = FIRST_THIRD + thirds_before;
#if RESTS
    const int across = 5 + (width - 1) / PART;
    __global volatile int *part = changed + (image * (height + 4) + 2 + row) * across + 2 + (int)get_group_id(0);
    /* Second order reads two cells away, which with parts of one cell are two parts. */
    const int farther = max(max(part[-2], part[2]), max(part[-2 * across], part[2 * across]));
    if (max(last_change_around(part, across), farther) < third - 3)
        return;
#endif
    const parameter_set numbers = parameters[image];
    const bounds within = bounds_from(limits, (size_t)images * (size_t)rows * (size_t)stride, 0);
    const size_t begin = (size_t)image * (size_t)rows * (size_t)stride;
    const size_t cell = begin + (size_t)(first_row + row) * (size_t)stride + (size_t)(first_column + column);
    const real moved = update_cell(log_depth, brightness, within, flags, cell, stride, 0, 0,
                                   axis_at(column_table + image * 3 * stride, stride, first_column + column),
                                   axis_at(row_table + image * 3 * rows, rows, first_row + row), &numbers);
#if RESTS
    if (moved > 0)
        *part = third;
#endif
}
