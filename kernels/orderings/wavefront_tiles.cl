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
 * With RESTS each tile has the number of the last sweep that changed it, as in tiles.cl, with one tile more on every
 * side. A tile is left alone if neither it nor those that it reads have changed since a sweep last went through it in
 * the same direction, four sweeps ago: it would find the same values again. For that, tiles are the same in all
 * directions.
 *
 * Global size (tiles * TILE_ROWS, images), work-group size (TILE_ROWS, 1). Reads and writes log_depth in place.
 */
#define FIRST_SWEEP 5

/* The last sweep that changed a tile, or one that it reads. */
static inline int last_change(__global const int *tile, const int stride, const int step, const int row_step)
{
    const int latest = max(tile[0], max(tile[-step], tile[-row_step * stride]));
#if DIRECTED && REACH == 1
    return latest;
#else
    return max(latest, max(tile[step], tile[row_step * stride]));
#endif
}

__kernel __attribute__((reqd_work_group_size(TILE_ROWS, 1, 1))) void
sweep(__global real *log_depth,          /* shape (images, rows, stride)                        */
      __global const real *brightness,   /* E, marked as in update.cl, same shape               */
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
      const int first_tile_row,          /* tile row of group 0                                 */
      __global int *changed,             /* see above, of each image                            */
      const int sweeps_before)           /* of this run                                         */
{
    const int image = (int)get_global_id(1);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    const parameter_set numbers = parameters[image];
    const size_t begin = (size_t)image * (size_t)rows * (size_t)stride;
    const int tile_row = first_tile_row + (int)get_group_id(0), tile_column = tile_diagonal - tile_row;
    const int high = (height + TILE_ROWS - 1) / TILE_ROWS, wide = (width + TILE_COLUMNS - 1) / TILE_COLUMNS;
    const int i = tile_row * TILE_ROWS + (int)get_local_id(0);
    const int first = tile_column * TILE_COLUMNS;
    const int row = upwards ? high * TILE_ROWS - 1 - i : i;

    const int sweep = FIRST_SWEEP + sweeps_before, tile_stride = wide + 2;
    __global int *tile = changed;
    if (RESTS) {
        tile += (size_t)image * (size_t)(high + 2) * (size_t)tile_stride;
        tile += (1 + (upwards ? high - 1 - tile_row : tile_row)) * tile_stride;
        tile += 1 + (leftwards ? wide - 1 - tile_column : tile_column);
        if (last_change(tile, tile_stride, leftwards ? -1 : 1, upwards ? -1 : 1) < sweep - 4)
            return;
    }
    int moved = 0;
    for (int step = 0; step < TILE_COLUMNS + TILE_ROWS - 1; ++step) {
        const int inside = step - (int)get_local_id(0);
        const int column = leftwards ? wide * TILE_COLUMNS - 1 - first - inside : first + inside;
        if (row < height && inside >= 0 && inside < TILE_COLUMNS && column < width) {
            const int stored_row = first_row + row, stored_column = first_column + column;
            const size_t cell = begin + (size_t)stored_row * (size_t)stride + (size_t)stored_column;
            moved |= update_cell(log_depth, brightness, flags, cell, stride, leftwards, upwards,
                                 axis_at(column_table + image * 3 * stride, stride, stored_column),
                                 axis_at(row_table + image * 3 * rows, rows, stored_row), &numbers);
        }
        barrier(CLK_GLOBAL_MEM_FENCE);
    }
    /* All items that write this write the same. */
    if (RESTS && moved)
        *tile = sweep;
}
