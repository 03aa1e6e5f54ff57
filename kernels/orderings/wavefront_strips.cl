/* Up to four sweeps by anti-diagonals, bit for bit the lexicographic ones, in one launch by strips that overlap in time.
 *
 *      strip 0   ####====....      A strip may run as long as the one before it is STRIP_ROWS - 1 columns ahead, which
 *      strip 1   ##==........      says how many blocks it has finished.
 *      strip 2   =...........
 *
 * Two sweeps that go through the rows in the same order overlap: the second may take up a strip as soon as the first is
 * done with it and with the next one, whose cells it reads. So groups seldom have to run side by side on neighbouring
 * strips, where each waits for the slower one, and a strip is still in the cache when the second sweep comes. The third
 * sweep, which turns round, begins where the second ends.
 *
 * A work-group claims a strip that can run at once, or else the first that is unclaimed, so that the one it waits for
 * is done or another group's. A wait is short while every group has a processor. When one has lost its own to another
 * program, the groups that wait would keep theirs from it: a group whose wait times out hands its strip back and ends,
 * and the group that was waited for takes the strip up when it comes to it. The last group never ends before all is
 * done: there is no deadlock, however the groups are scheduled.
 *
 * A work-item runs along a strip, see strip.cl. Work-group size 1; any number of groups. Strips of several images
 * follow each other in turn: first strip of each image, second strip of each, and so on. `sync` counts over the whole
 * run and is never reset: groups that have ended, once for each sweep of their launch, the sweeps in which each strip
 * has been claimed, and the blocks that each has finished. Reads and writes log_depth in place.
 */
#define ENDED 0
#define FIRST_CLAIM 1

/* What all groups of a launch share. */
typedef struct {
    __global volatile int *claims;   /* shape (strips, images) */
    __global volatile int *progress; /* shape (images, strips) */
    int images, strips, blocks;      /* strips of an image, blocks of a strip */
    int first_sweep, sweeps, sweeps_before;
} launch;

static inline __global volatile int *progress_of(const launch *all, const int image, const int strip)
{
    return all->progress + (image * all->strips + strip) * APART;
}

/* Blocks that a strip has counted when so many sweeps of this launch are over. */
static inline int blocks_after(const launch *all, const int sweeps)
{
    return (all->sweeps_before + sweeps) * all->blocks;
}

/* The strip of the sweep before that must be done before this one may begin. */
static inline int strip_to_leave(const launch *all, const int sweep, const int strip)
{
    const int turns_round = ((all->first_sweep + sweep) & 1) == 0;
    return turns_round ? all->strips - 1 : min(strip + 1, all->strips - 1);
}

/* Whether a strip can run without a wait, as far as the counters say now. */
static inline int ready(const launch *all, const int number, const int sweep)
{
    const int image = number % all->images, strip = number / all->images;
    if (strip > 0 && *progress_of(all, image, strip - 1) < blocks_after(all, sweep + 1))
        return 0;
    return sweep == 0 || *progress_of(all, image, strip_to_leave(all, sweep, strip)) >= blocks_after(all, sweep);
}

/* Claims a strip and a sweep for this group, and returns its number; that of all strips if there is none left. */
static inline int claim(const launch *all, int *sweep_of_strip)
{
    const int total = all->strips * all->images;
    for (int any = 0; any < 2; ++any)
        for (int sweep = 0; sweep < all->sweeps; ++sweep) {
            const int unclaimed = all->sweeps_before + sweep;
            int looked_at = 0;
            for (int number = 0; number < total && looked_at < all->images; ++number) {
                if (all->claims[number] != unclaimed)
                    continue;
                /* Past the first of each image none is likely to be ready. */
                looked_at += !any;
                if ((any || ready(all, number, sweep)) &&
                    atomic_cmpxchg(all->claims + number, unclaimed, unclaimed + 1) == unclaimed) {
                    *sweep_of_strip = sweep;
                    return number;
                }
            }
        }
    return total;
}

static inline int all_claimed(const launch *all)
{
    for (int number = 0; number < all->strips * all->images; ++number) {
        const int sweep = all->claims[number] - all->sweeps_before;
        if (sweep >= 0 && sweep < all->sweeps)
            return 0;
    }
    return 1;
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void
sweep(__global real *log_depth,          /* shape (images, rows, stride), padded as in strip.cl             */
      __global const real *brightness,   /* E, marked as in update.cl, same shape                            */
      __global const real *limits,       /* as many as LIMITS says, of that shape each                       */
      __global const uchar *flags,       /* same shape                                                       */
      __global const parameter_set *parameters, /* shape (images,)                                                  */
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
      const int first_sweep,             /* of this launch, 0 to 3: odd ones leftwards, the last two upwards */
      const int sweeps,                  /* of this launch, 1 to 4                                           */
      __global volatile int *sync,       /* shape (FIRST_CLAIM + (1 + APART) * images * strips)              */
      const int sweeps_before,           /* of this run                                                      */
      const int polls,                   /* in vain, before a group gives up: see patience_for               */
      __global volatile int *changed,    /* see tiles.cl, of each image                                      */
      __global real *drift,              /* see strip.cl, of each image                                      */
      const real resting)                /* likewise                                                         */
{
    const int strips = (height + STRIP_ROWS - 1) / STRIP_ROWS, total = strips * images;
    const launch all = {sync + FIRST_CLAIM, sync + FIRST_CLAIM + total, images, strips, blocks_of(width), first_sweep,
                        sweeps, sweeps_before};
    const int patience = patience_for(polls, width);
    const int last_to_end = (sweeps_before + sweeps) * (int)get_num_groups(0) - sweeps;
    for (;;) {
        int sweep_of_strip = 0;
        const int number = claim(&all, &sweep_of_strip);
        if (number < total) {
            const int image = number % images, strip = number / images;
            if (finished(changes, iteration, image, images, tolerance))
                continue;
            const int direction = first_sweep + sweep_of_strip, upwards = direction / 2;
            const int done_before = blocks_after(&all, sweep_of_strip);
            __global volatile int *left = progress_of(&all, image, strip_to_leave(&all, sweep_of_strip, strip));
            int whole = sweep_of_strip == 0 || wait_for(left, done_before, patience) >= done_before;
            if (whole) {
                const size_t size = (size_t)rows * (size_t)stride, begin = (size_t)image * size;
                const bounds within = bounds_from(limits, (size_t)images * size, begin);
                __global volatile int *done = progress_of(&all, image, strip);
                const int first_block = atomic_add(done, 0) - done_before;
                __global real *z = log_depth + begin;
                __global const real *e = brightness + begin;
                __global volatile int *last_changes = changed + image * tiles_of_image(height, width);
                __global real *drifts = drift + (RESTS == 2 ? image * tiles_of_image(height, width) : 0);
                const int sweep = FIRST_SWEEP + sweeps_before + sweep_of_strip;
                const parameter_set numbers = parameters[image];
                __global const real *x = column_table + image * 6 * stride, *y = row_table + image * 3 * rows;
                /* The flag as a constant, for two loops with straight addressing. */
                if (direction & 1)
                    whole = run_strip(z, e, within, flags + begin, &numbers, x, y, done, last_changes, drifts, rows,
                                      stride, first_row, first_column, height, width, 1, upwards, strip, first_block,
                                      done_before, patience, sweep, resting, 0);
                else
                    whole = run_strip(z, e, within, flags + begin, &numbers, x, y, done, last_changes, drifts, rows,
                                      stride, first_row, first_column, height, width, 0, upwards, strip, first_block,
                                      done_before, patience, sweep, resting, 0);
            }
            if (whole)
                continue;
            atomic_xchg(all.claims + number, sweeps_before + sweep_of_strip);
        }
        /* The last group to end sees all that the others have handed back, and goes on if there is any. */
        if (atomic_add(sync + ENDED, sweeps) < last_to_end)
            return;
        if (number == total && all_claimed(&all))
            return;
        atomic_sub(sync + ENDED, sweeps);
    }
}
