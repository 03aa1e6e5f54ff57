/* One sweep by anti-diagonals, bit for bit the lexicographic one, in one launch: strips that follow each other closely.
 *
 *      strip 0   ####====....      A strip may run as long as the one before it is STRIP_ROWS - 1 columns ahead. Strips
 *      strip 1   ##==........      are claimed by an atomic ticket, in order, so that the one waited for is always running
 *      strip 2   =...........      or done; it says how many blocks it has finished. The wait is bounded: past
 *                                  PATIENCE polls the run is given up, and the host told.
 *
 * Work-group size 1; any number of groups. Strips of several images follow each other in turn: first strip of each
 * image, second strip of each, and so on. `sync` counts over the whole run and is never reset: the ticket, the number of
 * failures, then the finished blocks of each strip.
 */
#define TICKET 0
#define FAILURES 1
#define FIRST_PROGRESS 2

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
sweep(__global real *log_depth,          /* shape (images, rows, stride), padded as in strip.cl             */
      __global const real *brightness,   /* E, marked as in cell.cl, same shape                              */
      __global const uchar *flags,       /* same shape                                                       */
      __global const real *parameters,   /* shape (images, PARAMETERS)                                       */
      __global const real *column_table, /* as elsewhere, and once more reversed, shape (images, 6, stride)  */
      __global const real *row_table,    /* shape (images, 3, rows)                                          */
      __global const float *changes,     /* see prelude                                                      */
      const int iteration,               /* index into changes                                               */
      const float tolerance,             /* on max |dZ|                                                      */
      const int rows,                    /* stored rows, padding included                                    */
      const int stride,                  /* stored columns, padding included                                 */
      const int first_row,               /* of the image within its padding                                  */
      const int first_column,            /* likewise                                                         */
      const int height,                  /* pixels                                                           */
      const int width,                   /* pixels                                                           */
      const int leftwards,               /* 1: columns from the right                                        */
      const int upwards,                 /* 1: rows from the bottom                                          */
      __global volatile int *sync,       /* shape (FIRST_PROGRESS + images * strips)                         */
      const int images,                  /* in this launch                                                   */
      const int sweeps_before)           /* launches of this run so far                                      */
{
    const int strips = (height + STRIP_ROWS - 1) / STRIP_ROWS;
    const int blocks = (width + STRIP_ROWS - 1 + 7) / 8;
    /* Every group draws one ticket too many in each launch. */
    const int first_ticket = sweeps_before * (strips * images + (int)get_num_groups(0));
    for (;;) {
        const int ticket = atomic_inc(sync + TICKET) - first_ticket;
        if (ticket >= strips * images || atomic_add(sync + FAILURES, 0) != 0)
            return;
        const int image = ticket % images, strip = ticket / images;
        if (finished(changes, iteration, image, images, tolerance))
            continue;
        const size_t begin = (size_t)image * (size_t)rows * (size_t)stride;
        __global volatile int *progress = sync + FIRST_PROGRESS + image * strips + strip;
        __global real *z = log_depth + begin;
        __global const real *e = brightness + begin;
        real numbers[PARAMETERS];
        copy_parameters(numbers, parameters, image);
        __global const real *x = column_table + image * 6 * stride, *y = row_table + image * 3 * rows;
        const int done_before = sweeps_before * blocks;
        const int good =
            leftwards ? run_strip(z, e, flags + begin, numbers, x, y, sync + FAILURES, progress, rows, stride, first_row,
                                  first_column, height, width, 1, upwards, strip, done_before, 0)
                      : run_strip(z, e, flags + begin, numbers, x, y, sync + FAILURES, progress, rows, stride, first_row,
                                  first_column, height, width, 0, upwards, strip, done_before, 0);
        if (!good)
            return;
    }
}
