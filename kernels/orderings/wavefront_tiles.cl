/* One sweep by anti-diagonals, bit for bit the lexicographic one: the cells of one anti-diagonal do not read each
 * other, since they read only neighbours along x and y. The variant for devices with many work-items; no group waits
 * for another.
 *
 * The grid is cut into tiles; the tiles of one anti-diagonal of tiles are independent too, and make one launch. A
 * work-group takes a tile, a work-item one row of it. In step s the item of row r updates column s - r of the tile, so
 * that the items stand on one anti-diagonal; a barrier ends the step.
 *
 *        tiles of launch 3      steps in a tile
 *         . . . 3                0 1 2 3 4
 *         . . 3 .                1 2 3 4 5
 *         . 3 . .                2 3 4 5 6
 *
 * Global size (tiles * TILE_ROWS, images), work-group size (TILE_ROWS, 1). Reads and writes log_depth in place.
 */
__kernel __attribute__((reqd_work_group_size(TILE_ROWS, 1, 1))) void
sweep(__global real *log_depth,          /* shape (images, rows, stride)                        */
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
      const int upwards,                 /* 1: rows from the bottom                             */
      const int tile_diagonal,           /* row + column of the tiles of this launch            */
      const int first_tile_row)          /* tile row of group 0                                 */
{
    const int image = (int)get_global_id(1);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    const parameter_set numbers = parameters[image];
    const bounds within = bounds_from(limits, (size_t)images * (size_t)rows * (size_t)stride, 0);
    const size_t begin = (size_t)image * (size_t)rows * (size_t)stride;
    const int tile_row = first_tile_row + (int)get_group_id(0);
    const int i = tile_row * TILE_ROWS + (int)get_local_id(0);
    const int first = (tile_diagonal - tile_row) * TILE_COLUMNS;

    for (int step = 0; step < TILE_COLUMNS + TILE_ROWS - 1; ++step) {
        const int inside = step - (int)get_local_id(0);
        const int j = first + inside;
        if (i < height && inside >= 0 && inside < TILE_COLUMNS && j < width) {
            const int row = first_row + (upwards ? height - 1 - i : i);
            const int column = first_column + (leftwards ? width - 1 - j : j);
            const size_t cell = begin + (size_t)row * (size_t)stride + (size_t)column;
            update_cell(log_depth, brightness, within, flags, cell, stride, leftwards, upwards,
                        axis_at(column_table + image * 3 * stride, stride, column),
                        axis_at(row_table + image * 3 * rows, rows, row), &numbers);
        }
        barrier(CLK_GLOBAL_MEM_FENCE);
    }
}
