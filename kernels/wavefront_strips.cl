/* One sweep by anti-diagonals, bit for bit the lexicographic one, in one launch: strips that follow each other closely.
 *
 *      strip 0   ####====....      A strip may run as long as the one before it is STRIP_ROWS - 1 columns ahead, which
 *      strip 1   ##==........      says how many blocks it has finished. A work-group claims the first strip that nobody
 *      strip 2   =...........      has, so that the one waited for is done or someone else's.
 *
 * The wait is short while every group has a processor. When one has lost its own (other programs want it too), the groups
 * that wait would keep theirs from it: past POLLS polls a group hands its strip back and ends, and the group that was
 * waited for takes the strip up when it comes to it. The last group never ends before all is done: there is no wait in
 * vain, however the groups are scheduled.
 *
 * Work-group size 1; any number of groups. Strips of several images follow each other in turn: first strip of each
 * image, second strip of each, and so on. `sync` counts over the whole run and is never reset: groups that have ended, the
 * launches in which each strip has been claimed, and the blocks that each has finished.
 */
#define ENDED 0
#define FIRST_CLAIM 1

/* The first strip that nobody has claimed in this launch, or the number of all strips. */
static inline int claim(__global volatile int *claims, const int strips, const int launches_before)
{
    for (int strip = 0; strip < strips; ++strip)
        if (claims[strip] == launches_before &&
            atomic_cmpxchg(claims + strip, launches_before, launches_before + 1) == launches_before)
            return strip;
    return strips;
}

static inline int all_claimed(__global volatile int *claims, const int strips, const int launches_before)
{
    for (int strip = 0; strip < strips; ++strip)
        if (claims[strip] == launches_before)
            return 0;
    return 1;
}

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
      const int images,                  /* of this run                                                      */
      const int rows,                    /* stored rows, padding included                                    */
      const int stride,                  /* stored columns, padding included                                 */
      const int first_row,               /* of the image within its padding                                  */
      const int first_column,            /* likewise                                                         */
      const int height,                  /* pixels                                                           */
      const int width,                   /* pixels                                                           */
      const int leftwards,               /* 1: columns from the right                                        */
      const int upwards,                 /* 1: rows from the bottom                                          */
      __global volatile int *sync,       /* shape (FIRST_CLAIM + (1 + APART) * images * strips)                */
      const int launches_before)         /* of this run                                                       */
{
    const int strips = (height + STRIP_ROWS - 1) / STRIP_ROWS, total = strips * images;
    const int groups = (int)get_num_groups(0), done_before = launches_before * blocks_of(width);
    __global volatile int *claims = sync + FIRST_CLAIM, *progress = claims + total;
    for (;;) {
        const int number = claim(claims, total, launches_before);
        if (number < total) {
            const int image = number % images, strip = number / images;
            if (finished(changes, iteration, image, images, tolerance))
                continue;
            const size_t begin = (size_t)image * (size_t)rows * (size_t)stride;
            __global volatile int *done = progress + (image * strips + strip) * APART;
            const int first_block = atomic_add(done, 0) - done_before;
            __global real *z = log_depth + begin;
            __global const real *e = brightness + begin;
            real numbers[PARAMETERS];
            copy_parameters(numbers, parameters, image);
            __global const real *x = column_table + image * 6 * stride, *y = row_table + image * 3 * rows;
            const int whole =
                leftwards ? run_strip(z, e, flags + begin, numbers, x, y, done, rows, stride, first_row, first_column,
                                      height, width, 1, upwards, strip, first_block, done_before, 0)
                          : run_strip(z, e, flags + begin, numbers, x, y, done, rows, stride, first_row, first_column,
                                      height, width, 0, upwards, strip, first_block, done_before, 0);
            if (whole)
                continue;
            atomic_xchg(claims + number, launches_before);
        }
        /* The last group to end sees all that the others have handed back, and goes on if that is anything. */
        if (atomic_inc(sync + ENDED) < (launches_before + 1) * groups - 1)
            return;
        if (number == total && all_claimed(claims, total, launches_before))
            return;
        atomic_dec(sync + ENDED);
    }
}
