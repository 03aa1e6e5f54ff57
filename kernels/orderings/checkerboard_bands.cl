/* Several half-sweeps of the checkerboard in one launch, on bands of rows, each band as soon as its neighbours allow.
 *
 * A band may do its next half-sweep when both its neighbours have done as many; no neighbour can then be more than one
 * ahead. So a work-group goes down the image along a slope, and a band gets all its half-sweeps while it is cached:
 *
 *      half-sweep   0   1   2   3
 *      band 0       0   2   5   9      the order in which one group alone takes four half-sweeps of five bands:
 *      band 1       1   4   8  13      by fronts, each from the left to the right and upwards
 *      band 2       3   7  12  16
 *      band 3       6  11  15  18
 *      band 4      10  14  17  19
 *
 * The values are those of one half-sweep of all bands after the other, bit for bit, as cells of one colour read only
 * the other. The last stage of an iteration is the search for the largest change, if that is wanted; all bands of an
 * image must be through before the first begins the next iteration, since the image may have come to rest.
 *
 * Every group goes through all images and bands in turn, from a place of its own, and takes what is free and ready. Of
 * an image at which others are at work it polls the bands for a while; then it goes on, and ends after a turn in which
 * it has found nothing. So no group waits for another without end, however the groups are scheduled: what is left then
 * lies with groups that still work, and that go through all once more before they end.
 *
 * With RESTS each band has a row of segments, and each of these, for both colours, the number of the last half-sweep
 * that changed it, see account.cl. A segment is left alone if its colour has not changed when it last had its turn, nor
 * the other one since, there and beside it: it would find the same values again. Before the first half-sweep,
 * FIRST_HALF, a segment has FIRST_HALF - 1, or 0 where there is nothing to sweep.
 *
 * Work-group size 1; any number of groups. `sync` counts over the whole run and is never reset: for each image the
 * bands that have finished their iterations, and for each band of each image twice the stages done, plus one while some
 * group does the next. Reads and writes log_depth in place.
 */
#define SEGMENT (RESTS ? 4 : INT_MAX / 2) /* vectors of a colour */
#define FIRST_HALF 3
#define CHEAPER 32 /* a poll of counters that lie close together, in the cache, than one of those of strips */

/* Claims a stage of a band for this group: 1 if that succeeds; `done` is the state of a band that is ready for it. */
static inline int claim(__global volatile int *states, const int bands, const int band, const int done)
{
    __global volatile int *state = states + band;
    if (*state != done || (band > 0 && state[-1] < done) || (band < bands - 1 && state[1] < done) ||
        atomic_cmpxchg(state, done, done + 1) != done)
        return 0;
    FENCE();
    return 1;
}

/* An image, and what is to be done with it. */
typedef struct {
    __global real *log_depth;
    __global const real *brightness;
    bounds within;
    __global const uchar *flags;
    const parameter_set *parameters;
    __global const real *column_table, *row_table;
    __global real *previous;
    __global float *change; /* of the iteration */
    __global volatile int *changed; /* see account.cl, shape (2, bands + 2, segments + 2) */
    int rows, stride, first_colour, band_rows, bands, halves;
    int first_half; /* of the iteration                                                */
    int since;      /* the half-sweep that came first after the last search for the change */
    int patience;   /* polls without success before a group goes on                     */
} picture;

static inline int segments_of(const int stride)
{
    return 1 + (vectors_of(stride) - 1) / SEGMENT;
}

/* Those of an image in the account of a colour. */
static inline int account_of(const int bands, const int stride)
{
    return (bands + 2) * (segments_of(stride) + 2);
}

/* Where the first segment of a band stands there. */
static inline int place_of(const picture *image, const int band)
{
    return (band + 1) * (segments_of(image->stride) + 2) + 1;
}

/* A half-sweep of the rows of a band. */
static inline void sweep_band(const picture *image, const int band, const int top, const int bottom, const int stage)
{
    const int segments = segments_of(image->stride), now = image->first_half + stage;
    const int parts = account_of(image->bands, image->stride);
    for (int segment = 0; segment < segments; ++segment) {
        const int part = place_of(image, band) + segment, own = part_of_colour(part, parts, now);
        if (RESTS && !colour_may_change(image->changed, part, parts, segments + 2, now))
            continue;
        const int first = SEGMENT * segment, last = min(first + SEGMENT, vectors_of(image->stride));
        number moved = 0;
        for (int row = top; row < bottom; ++row)
            moved = most(moved, update_colour(image->log_depth, image->brightness, image->within, image->flags,
                                              image->parameters, image->column_table, image->row_table, image->rows,
                                              image->stride, row, (image->first_colour + stage) & 1, first, last, 1));
        if (RESTS && any_sign(as_integer(0 - moved)))
            image->changed[own] = now;
    }
}

/* Whether a band has changed since the last search for the change. */
static inline int has_changed(const picture *image, const int band)
{
    __global volatile int *changed = image->changed + place_of(image, band);
    const int parts = account_of(image->bands, image->stride);
    int latest = 0;
    for (int segment = 0; RESTS && segment < segments_of(image->stride); ++segment)
        latest = max(latest, max(changed[segment], changed[parts + segment]));
    return !RESTS || latest >= image->since;
}

static inline void do_stage(const picture *image, const int band, const int stage)
{
    const int top = 1 + band * image->band_rows, bottom = min(top + image->band_rows, image->rows - 1);
    const size_t stride = (size_t)image->stride;
    if (stage < image->halves)
        sweep_band(image, band, top, bottom, stage);
    else if (has_changed(image, band)) {
        const float change = largest_change(image->log_depth, image->previous, top * stride / LANES,
                                            bottom * stride / LANES, 1);
        atomic_max((__global int *)image->change, as_int(change));
    }
}

/* Takes what is ready of an iteration of an image until nothing is left, or nothing has been found for a while; returns
 * 1 if there was any.
 */
static inline int iterate(const picture *image, __global volatile int *states, __global volatile int *through,
                          const int stages, const int first_stage)
{
    const int bands = image->bands, fronts = bands + stages - 1;
    const int first_front = (int)((long)fronts * (long)get_group_id(0) / (long)get_num_groups(0));
    int found = 0, left = 1;
    for (int looks = 0; left && looks < image->patience; looks += fronts * stages) {
        left = 0;
        for (int k = 0; k < fronts; ++k) {
            const int front = (first_front + k) % fronts;
            for (int stage = max(0, front - bands + 1); stage < min(stages, front + 1); ++stage) {
                const int band = front - stage;
                left |= states[band] < 2 * (first_stage + stages);
                if (!claim(states, bands, band, 2 * (first_stage + stage)))
                    continue;
                do_stage(image, band, stage);
                FENCE();
                atomic_xchg(states + band, 2 * (first_stage + stage + 1));
                FENCE();
                if (stage == image->halves)
                    atomic_inc(through);
                found = 1;
                looks = 0;
            }
        }
    }
    return found;
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
sweep(__global real *log_depth,          /* shape (images, rows, stride), columns apart         */
      __global const real *brightness,   /* E, marked as in update.cl, same shape               */
      __global const real *limits,       /* as many as LIMITS says, of that shape each          */
      __global const uchar *flags,       /* same shape                                          */
      __global const parameter_set *parameters, /* shape (images,)                                     */
      __global const real *column_table, /* shape (images, 3, stride), columns apart            */
      __global const real *row_table,    /* shape (images, 3, rows)                             */
      __global float *changes,           /* see prelude                                         */
      const int iteration,               /* first of this launch, index into changes            */
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
      __global real *previous,           /* Z before an iteration, shape of log_depth           */
      __global volatile int *changed,    /* see above, of each image                            */
      const int sweeps_before,           /* of this run                                         */
      const int measured_sweeps,         /* those before the last search for the change         */
      const int polls)                   /* in vain before a group goes on: see CHEAPER         */
{
    const int bands = (rows - 2 + band_rows - 1) / band_rows, stages = halves + measured;
    const int group = (int)get_group_id(0), groups = (int)get_num_groups(0);
    const size_t account = RESTS ? 2 * (size_t)account_of(bands, stride) : 0;
    const int first_image = (int)((long)images * group / groups);
    for (int found = 1; found;) {
        found = 0;
        for (int k = 0; k < images; ++k) {
            const int image = (first_image + k) % images;
            const size_t size = (size_t)rows * (size_t)stride, begin = (size_t)image * size;
            __global volatile int *through = sync + image, *states = sync + images + image * bands;
            const parameter_set numbers = parameters[image];
            for (int done = 0; done < iterations; ++done) {
                const int now = iteration + done;
                if (measured && atomic_add(through, 0) < (iterations_before + done) * bands)
                    break;
                FENCE();
                if (finished(changes, now, image, images, tolerance))
                    break;
                const int first_half = FIRST_HALF + 2 * sweeps_before + done * halves;
                const picture all = {log_depth + begin,
                                     brightness + begin,
                                     bounds_from(limits, (size_t)images * size, begin),
                                     flags + begin,
                                     &numbers,
                                     column_table + image * 3 * stride,
                                     row_table + image * 3 * rows,
                                     previous + begin,
                                     changes + now * images + image,
                                     changed + image * account,
                                     rows,
                                     stride,
                                     first_colour,
                                     band_rows,
                                     bands,
                                     halves,
                                     first_half,
                                     done > 0 ? first_half : FIRST_HALF + 2 * measured_sweeps,
                                     CHEAPER * polls};
                found |= iterate(&all, states, through, stages, stages_before + done * stages);
            }
        }
    }
}
