/* Half a sweep: all cells of one colour, which is the parity of row + column. Two launches visit every cell once.
 *
 * The iterates are not those of the lexicographic order, but the fixed point is that of a monotone scheme, and Z never
 * increases. The work-items of a row share its vectors of LANES cells: global size (items, rows - 2, images). Reads and
 * writes log_depth in place.
 *
 * With RESTS each item takes one vector at most, and a group, which takes PART of a row, is left alone if nothing can
 * have changed there, see account.cl. An item may find what another of its group has just noted: that one would not
 * have come so far had the group been left alone. Half-sweeps count from FIRST_HALF; before it a part has
 * FIRST_HALF - 1, or 0 where there is nothing to sweep.
 */
#define FIRST_HALF 3

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
                    const int colour,                  /* parity of stored row + column of the cells          */
                    __global volatile int *changed,    /* shape (images, 2, rows, parts + 2), see account.cl  */
                    const int halves_before)           /* of this run                                         */
{
    const int image = (int)get_global_id(2);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    const parameter_set numbers = parameters[image];
    const size_t size = (size_t)rows * (size_t)stride, begin = (size_t)image * size;
    const bounds within = bounds_from(limits, (size_t)images * size, begin);
    const int row = 1 + (int)get_global_id(1), turn = FIRST_HALF + halves_before;
#if RESTS
    const int across = 3 + (vectors_of(stride) - 1) / PART, parts = rows * across;
    const int part = row * across + 1 + (int)get_group_id(0), account = 2 * image * parts;
    /* The launch has whole groups. */
    if ((int)get_group_id(0) >= across - 2 || !colour_may_change(changed + account, part, parts, across, turn))
        return;
#endif
    const number moved =
        update_colour(log_depth + begin, brightness + begin, within, flags + begin, &numbers,
                      column_table + image * 3 * stride, row_table + image * 3 * rows, rows, stride, row, colour,
                      (int)get_global_id(0), vectors_of(stride), (int)get_global_size(0));
#if RESTS
    if (any_sign(as_integer(0 - moved)))
        changed[account + part_of_colour(part, parts, turn)] = turn;
#endif
}
