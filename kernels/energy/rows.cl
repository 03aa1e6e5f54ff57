/* Padded arrays, and loops over a row of an image.
 *
 * Arrays of the energy have PAD cells more than the image on each side, and more to the right. They hold 0 there, so that
 * no kernel asks where the image ends, and vectors may reach beyond it.
 *
 * The work-items of a row take turns, LANES pixels at a time: on processors one does all of it, on others neighbours
 * stand side by side. What they add up, each of them writes for itself; the host adds that up, in one order, so that a
 * device gives the same bits every time.
 */
#define PAD 2

#define FOR_EACH_OF_ROW(column)                                                                                        \
    for (int column = (int)get_global_id(0) * LANES; column < width; column += (int)get_global_size(0) * LANES)

/* Place of a pixel in a padded array of which rows are `stride` apart. */
static inline size_t cell_at(const int column, const int row, const int stride)
{
    return (size_t)(row + PAD) * (size_t)stride + (size_t)(column + PAD);
}

/* Place of what a work-item has added up. */
static inline size_t place_of_item(void)
{
    return get_global_id(1) * get_global_size(0) + get_global_id(0);
}

/* Sum of the lanes, and the largest of them. */
static inline real sum_of_lanes(const number values)
{
#if LANES == 8
    const JOIN(REAL, 4) four = values.lo + values.hi;
    const JOIN(REAL, 2) two = four.lo + four.hi;
    return two.x + two.y;
#elif LANES == 4
    const JOIN(REAL, 2) two = values.lo + values.hi;
    return two.x + two.y;
#elif LANES == 2
    return values.x + values.y;
#else
    return values;
#endif
}

static inline real most_of_lanes(const number values)
{
#if LANES == 8
    const JOIN(REAL, 4) four = values.lo > values.hi ? values.lo : values.hi;
    const JOIN(REAL, 2) two = four.lo > four.hi ? four.lo : four.hi;
    return two.x > two.y ? two.x : two.y;
#elif LANES == 4
    const JOIN(REAL, 2) two = values.lo > values.hi ? values.lo : values.hi;
    return two.x > two.y ? two.x : two.y;
#elif LANES == 2
    return values.x > values.y ? values.x : values.y;
#else
    return values;
#endif
}
