/* Several half-sweeps of the checkerboard in one launch, on bands of rows, each as far as it can be.
 *
 * A band may do its next half-sweep when both its neighbours have done as many; no neighbour can then be more than one
 * ahead. So a work-group goes down the image along a slope, and a band gets all its half-sweeps while it is in the cache:
 *
 *      half-sweep   0   1   2   3
 *      band 0       0   2   5   9      in which order one group alone takes four half-sweeps of five bands:
 *      band 1       1   4   8  13      by fronts, each from the left to the right and upwards
 *      band 2       3   7  12  16
 *      band 3       6  11  15  18
 *      band 4      10  14  17  19
 *
 * The values are those of one half-sweep of all bands after the other, bit for bit, as cells of one colour read only the
 * other. The last stage of an iteration is the search for the largest change, if that is wanted; all bands of an image
 * must be through before the first begins the next iteration, since the image may have come to rest.
 *
 * Every group walks over all images and bands, from a place of its own and round, and takes what is free and ready. It
 * looks some times at an image where others are at work; then it goes on, and ends when it has come round without having
 * found anything. So nothing is waited for in vain, however the groups are scheduled: what is left then lies with groups
 * that still work, and that come round once more before they end.
 *
 * Work-group size 1; any number of groups. `sync` counts over the whole run and is never reset: for each image the bands
 * that are through their iterations, and for each band of each image twice the stages done, and one more while some group
 * does the next. In place.
 */
#define LOOKS (32 * POLLS) /* in vain, at what lies in the cache: some hundred microseconds */

/* What stays the same in an iteration. */
typedef struct {
    __global volatile int *through; /* of an image, see above */
    __global volatile int *states;  /* of an image, see above */
    int bands, stages, measured, first_stage;
} progress;

/* Whether this group has the next stage of a band now. */
static inline int claim(const progress *all, const int band, const int stage)
{
    __global volatile int *state = all->states + band;
    const int before = 2 * (all->first_stage + stage);
    if (*state != before || (band > 0 && state[-1] < before) || (band < all->bands - 1 && state[1] < before) ||
        atomic_cmpxchg(state, before, before + 1) != before)
        return 0;
    mem_fence(CLK_GLOBAL_MEM_FENCE);
    return 1;
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
sweep(__global real *log_depth,          /* shape (images, rows, stride), columns apart         */
      __global const real *brightness,   /* E, marked as in cell.cl, same shape                 */
      __global const uchar *flags,       /* same shape                                          */
      __global const real *parameters,   /* shape (images, PARAMETERS)                          */
      __global const real *column_table, /* shape (images, 3, stride), columns apart            */
      __global const real *row_table,    /* shape (images, 3, rows)                             */
      __global float *changes,           /* see prelude                                         */
      const int first_iteration,         /* index into changes                                  */
      const float tolerance,             /* on max |dZ|                                         */
      const int images,                  /* of this run                                         */
      const int rows,                    /* stored rows, padding included                       */
      const int stride,                  /* stored columns, padding included                    */
      const int first_colour,            /* parity of stored row + column                       */
      const int iterations,              /* of this launch                                      */
      const int halves,                  /* half-sweeps of an iteration, an even number         */
      const int measured,                /* 1: the change of the iterations is wanted           */
      const int band_rows,               /* rows of a band                                      */
      __global volatile int *sync,       /* see above, shape (images * (1 + bands),)            */
      const int stages_before,           /* of this run                                         */
      const int iterations_before,       /* of this run                                         */
      __global real *previous)           /* Z before an iteration, shape of log_depth           */
{
    const int bands = (rows - 2 + band_rows - 1) / band_rows, stages = halves + measured;
    const int fronts = bands + stages - 1;
    const int group = (int)get_group_id(0), groups = (int)get_num_groups(0);
    const int first_image = (int)((long)images * group / groups), first_front = (int)((long)fronts * group / groups);
    for (int found = 1; found;) {
        found = 0;
        for (int k = 0; k < images; ++k) {
            const int image = (first_image + k) % images;
            const size_t begin = (size_t)image * (size_t)rows * (size_t)stride;
            __global volatile int *through = sync + image, *states = sync + images + image * bands;
            real numbers[PARAMETERS];
            copy_parameters(numbers, parameters, image);
            for (int iteration = 0; iteration < iterations; ++iteration) {
                if (measured && atomic_add(through, 0) < (iterations_before + iteration) * bands)
                    break;
                mem_fence(CLK_GLOBAL_MEM_FENCE);
                if (finished(changes, first_iteration + iteration, image, images, tolerance))
                    break;
                const progress all = {through, states, bands, stages, measured, stages_before + iteration * stages};
                for (int looks = 0; looks < LOOKS; looks += fronts * stages) {
                    int left = 0;
                    for (int j = 0; j < fronts; ++j) {
                        const int front = (first_front + j) % fronts;
                        for (int stage = max(0, front - bands + 1); stage < min(stages, front + 1); ++stage) {
                            const int band = front - stage;
                            left += states[band] < 2 * (all.first_stage + stages);
                            if (!claim(&all, band, stage))
                                continue;
                            const int top = 1 + band * band_rows, bottom = min(top + band_rows, rows - 1);
                            if (stage < halves)
                                for (int row = top; row < bottom; ++row)
                                    update_colour(log_depth + begin, brightness + begin, flags + begin, numbers,
                                                  column_table + image * 3 * stride, row_table + image * 3 * rows,
                                                  rows, stride, row, (first_colour + stage) & 1, 0, 1);
                            else {
                                const float change =
                                    largest_change(log_depth + begin, previous + begin,
                                                   (size_t)top * stride / LANES, (size_t)bottom * stride / LANES, 1);
                                atomic_max((__global int *)(changes + (first_iteration + iteration) * images + image),
                                           as_int(change));
                            }
                            mem_fence(CLK_GLOBAL_MEM_FENCE);
                            atomic_xchg(states + band, 2 * (all.first_stage + stage + 1));
                            if (stage == halves)
                                atomic_inc(through);
                            found = 1;
                            looks = 0;
                        }
                    }
                    if (!left)
                        break;
                }
            }
        }
    }
}
