/* Which parts of an image a sweep has changed, so that others can rest: for each tile of LANES x LANES pixels the
 * number of the last sweep that changed it, counted from FIRST_SWEEP over the whole run. Before the first sweep a tile
 * has FIRST_SWEEP - 1, or 0 where there is nothing to sweep.
 *
 * The array of an image has BORDER tiles more on every side, to be read without a question; what stands there is of no
 * consequence.
 */
#define FIRST_SWEEP 5
#define BORDER 8

/* Tiles along a side of the image. */
static inline int tiles_of(const int length)
{
    return (length + LANES - 1) / LANES;
}

/* Numbers of an image. */
static inline size_t tiles_of_image(const int height, const int width)
{
    return (size_t)(tiles_of(height) + 2 * BORDER) * (size_t)(tiles_of(width) + 2 * BORDER);
}

/* As in change.cl, the largest change of an image, of every `step`th row of tiles: of the tiles that changed in or
 * after the sweep `since`, the first of the iteration. `first` is the cell of the first pixel.
 */
static inline float largest_change_of_tiles(__global const real *first, __global real *first_previous,
                                            __global const volatile int *changed, const int stride, const int height,
                                            const int width, const int since, const int begin, const int step)
{
    float largest = 0;
    for (int row = begin; row < tiles_of(height); row += step)
        for (int column = 0; column < tiles_of(width); ++column) {
            if (changed[(BORDER + row) * (tiles_of(width) + 2 * BORDER) + BORDER + column] < since)
                continue;
            for (int k = 0; k < LANES; ++k) {
                const size_t at = (size_t)(row * LANES + k) * (size_t)stride + (size_t)(column * LANES);
                const float change = largest_change(first + at, first_previous + at, 0, 1, 1);
                largest = change > largest ? change : largest;
            }
        }
    return largest;
}
