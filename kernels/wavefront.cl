/* One sweep by anti-diagonals, bit for bit the lexicographic one: with the five-point stencil the cells of one
 * anti-diagonal do not read each other.
 *
 * The grid is cut into tiles; the tiles of one anti-diagonal of tiles are independent too, and make one launch. A
 * work-group takes a tile, a work-item one row of it. In step s the item of row r updates column s - r of the tile, so
 * that the items stand on one anti-diagonal; a barrier ends the step.
 *
 * Work-group size TILE_ROWS, one group for each tile of the diagonal. Reads and writes log_depth in place.
 */
__kernel __attribute__((reqd_work_group_size(TILE_ROWS, 1, 1))) void
sweep(__global real *log_depth,          /* shape (height, width)                                */
      __global const real *brightness,   /* shape (height, width)                                */
      __global const uchar *flags,       /* shape (height, width)                                */
      __constant const real *parameters, /* see prelude and model                                */
      const int width,                   /* pixels                                               */
      const int height,                  /* pixels                                               */
      const int leftwards,               /* 1: columns from the right                            */
      const int upwards,                 /* 1: rows from the bottom                              */
      const int tile_diagonal,           /* row + column of the tiles of this launch             */
      const int first_tile_row)          /* tile row of group 0                                  */
{
    const int tile_row = first_tile_row + (int)get_group_id(0);
    const int row = tile_row * TILE_ROWS + (int)get_local_id(0);
    const int first_column = (tile_diagonal - tile_row) * TILE_COLUMNS;

    for (int step = 0; step < TILE_COLUMNS + TILE_ROWS - 1; ++step) {
        const int inside = step - (int)get_local_id(0);
        const int column = first_column + inside;
        if (row < height && inside >= 0 && inside < TILE_COLUMNS && column < width)
            update_cell(log_depth, brightness, flags, parameters, width, leftwards ? width - 1 - column : column,
                        upwards ? height - 1 - row : row);
        barrier(CLK_GLOBAL_MEM_FENCE);
    }
}
