/* Whole iterations of whole images: four sweeps by anti-diagonals, each followed by the renewal of the boundary, and
 * then the largest change. For images so small that a launch for each sweep would cost more than the sweep, or so many
 * that every processor has its own. The values are bit for bit those of the other variants.
 *
 * One work-item takes an image, which stays in the cache of its processor from sweep to sweep, and waits for nothing.
 * Work-group size 1; any number of groups, which draw images by an atomic ticket. Reads and writes log_depth in place.
 */
static inline void run_sweep(__global real *log_depth, __global const real *brightness, const bounds within,
                             __global const uchar *flags, const parameter_set *parameters,
                             __global const real *column_table, __global const real *row_table,
                             __global volatile int *changed, __global real *drift, const int rows, const int stride,
                             const int first_row,
                             const int first_column, const int height, const int width, const int leftwards,
                             const int upwards, const int number, const real resting)
{
    for (int strip = 0; strip * STRIP_ROWS < height; ++strip) {
        if (leftwards)
            run_strip(log_depth, brightness, within, flags, parameters, column_table, row_table, 0, changed, drift, rows,
                      stride, first_row, first_column, height, width, 1, upwards, strip, 0, 0, 0, number, resting, 1);
        else
            run_strip(log_depth, brightness, within, flags, parameters, column_table, row_table, 0, changed, drift, rows,
                      stride, first_row, first_column, height, width, 0, upwards, strip, 0, 0, 0, number, resting, 1);
    }
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
iterate(__global real *log_depth,          /* shape (images, rows, stride), padded as in strip.cl              */
        __global const real *brightness,   /* E, marked as in update.cl, same shape                            */
        __global const real *limits,       /* as many as LIMITS says, of that shape each                       */
        __global const uchar *flags,       /* same shape                                                       */
        __global const parameter_set *parameters, /* shape (images,)                                                  */
        __global const real *column_table, /* as in strip.cl, shape (images, 6, stride)                        */
        __global const real *row_table,    /* shape (images, 3, rows)                                          */
        __global float *changes,           /* see prelude; the rows of these iterations are written            */
        const int iteration,               /* first of this launch, index into changes                         */
        const float tolerance,             /* on max |dZ|                                                      */
        const int images,                  /* of this run                                                      */
        const int rows,                    /* stored rows, padding included                                    */
        const int stride,                  /* stored columns, padding included                                 */
        const int first_row,               /* of the image within its padding                                  */
        const int first_column,            /* likewise                                                         */
        const int height,                  /* pixels                                                           */
        const int width,                   /* pixels                                                           */
        const int iterations,              /* to be done                                                       */
        __global volatile int *sync,       /* tickets drawn in this run, shape (1,)                            */
        const int first_ticket,            /* drawn before this launch                                         */
        __global real *previous,           /* Z before an iteration, shape of log_depth                        */
        __global const int *counts,        /* this and the next four: see boundary.cl                          */
        __global const int *cells,
        __global const int4 *inwards,
        __global const int4 *beside,
        __global real *renewed,
        __global volatile int *changed,    /* see tiles.cl, of each image                                      */
        __global real *drift,              /* see strip.cl, of each image                                      */
        const real resting,                /* likewise                                                         */
        const int sweeps_before,           /* of this run                                                      */
        const int linear,                  /* 1: extrapolate, 0: outflow                                       */
        const float lowest)                /* floor of the linear extrapolation                                */
{
    const size_t size = (size_t)rows * (size_t)stride;
    for (;;) {
        const int image = atomic_inc(sync) - first_ticket;
        if (image >= images)
            return;
        const size_t begin = (size_t)image * size;
        __global real *z = log_depth + begin, *before = previous + begin;
        __global volatile int *last_changes = changed + image * tiles_of_image(height, width);
        __global real *drifts = drift + (RESTS == 2 ? image * tiles_of_image(height, width) : 0);
        const parameter_set numbers = parameters[image];
        const bounds within = bounds_from(limits, (size_t)images * size, begin);
        for (int k = iteration; k < iteration + iterations; ++k) {
            if (finished(changes, k, image, images, tolerance))
                break;
            for (int sweep = 0; sweep < 4; ++sweep) {
                run_sweep(z, brightness + begin, within, flags + begin, &numbers, column_table + image * 6 * stride,
                          row_table + image * 3 * rows, last_changes, drifts, rows, stride, first_row, first_column,
                          height, width, sweep & 1, sweep >> 1,
                          FIRST_SWEEP + sweeps_before + 4 * (k - iteration) + sweep, resting);
                for (int pass = 0; pass < 2; ++pass) {
                    const int2 part = part_of(counts, image, pass);
                    compute_renewed(z, &numbers, inwards, beside, renewed, part.x, part.y, 0, 1, linear, (real)lowest);
                    apply_renewed(z, within, cells, renewed, part.x, part.y, 0, 1);
                }
            }
#if RESTS
            const size_t first = (size_t)first_row * (size_t)stride + (size_t)first_column;
            changes[k * images + image] = largest_change_of_tiles(
                z + first, before + first, last_changes, stride, height, width,
                FIRST_SWEEP + sweeps_before + 4 * (k - iteration), 0, 1);
#else
            changes[k * images + image] = largest_change(z, before, 0, size / LANES, 1);
#endif
        }
    }
}
