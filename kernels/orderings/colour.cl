/* The cells of one colour of the checkerboard in a row, which read only cells of the other colour, by work-items that
 * share the row. Reads brightness, flags and tables, and reads and writes log_depth in place.
 *
 * The columns are stored apart, the even ones before the odd ones, so that the cells of one colour in a row are
 * contiguous: half the memory traffic, and whole vectors. Left and right neighbours are in the other half of the row.
 */
#define GAP (LANES > 4 ? LANES : 4) /* columns at the end of each half that are never written */

/* Vectors of a colour in a row. */
static inline int vectors_of(const int stride)
{
    return (stride / 2 - GAP) / LANES;
}

/* Here no neighbour comes before the others: a scheme with directions takes the least value of all four quadrants. */
static inline number value_from_all_sides(const number brightness, const number here, const number left,
                                          const number right, const number up, const number down,
                                          const real to_p, const real to_q, const axis x, const axis y,
                                          const parameter_set *parameters)
{
#if DIRECTED
    return least(least(inner_value(brightness, here, left, right, up, down, to_p, to_q, x, y, parameters),
                       inner_value(brightness, here, right, left, up, down, -to_p, to_q, x, y, parameters)),
                 least(inner_value(brightness, here, left, right, down, up, to_p, -to_q, x, y, parameters),
                       inner_value(brightness, here, right, left, down, up, -to_p, -to_q, x, y, parameters)));
#else
    return inner_value(brightness, here, left, right, up, down, to_p, to_q, x, y, parameters);
#endif
}

/* Updates, in place, the vectors `first`, `first + step`, ... before `last` of the cells of one colour in a row.
 * Returns the largest change, in each lane.
 */
static inline number update_colour(__global real *log_depth,          /* of one image, (rows, stride), columns apart */
                                 __global const real *brightness,   /* E, marked as in update.cl, same shape       */
                                 const bounds within,               /* see prelude.cl, same shape                  */
                                 __global const uchar *flags,       /* same shape                                  */
                                 const parameter_set *parameters,   /* of the image                                */
                                 __global const real *column_table, /* shape (3, stride), columns apart            */
                                 __global const real *row_table,    /* shape (3, rows)                             */
                                 const int rows, const int stride,
                                 const int row,    /* stored row                    */
                                 const int colour, /* parity of stored row + column */
                                 const int first, const int last, const int step)
{
    number moved = 0;
    const int half_stride = stride / 2;
    const int odd = (row + colour) & 1; /* these cells stand in the odd columns of their row */
    const long begin = (long)row * stride + odd * half_stride;
    const int to_left = odd ? -half_stride : half_stride - 1;
    __global real *cells = log_depth + begin;
    __global const real *shadings = brightness + begin;
    __global const real *columns = column_table + odd * half_stride;
    const axis y = {(number)row_table[row], (number)row_table[rows + row], (number)row_table[2 * rows + row]};
    const real to_p = parameters->sign * parameters->half_inverse_dx;
    const real to_q = parameters->sign * parameters->half_inverse_dy;

    for (int at = LANES * first; at < LANES * last; at += LANES * step) {
        __global real *cell = cells + at;
        const number shading = LOAD(shadings + at);
        const number here = LOAD(cell);
        const number left = LOAD(cell + to_left), right = LOAD(cell + to_left + 1);
        const number up = LOAD(cell - stride), down = LOAD(cell + stride);
        const axis x = {LOAD(columns + at), LOAD(columns + at + stride), LOAD(columns + at + 2 * stride)};

        const number value = value_from_all_sides(shading, here, left, right, up, down, to_p, to_q, x, y, parameters);
        number limits[LIMITS + 1];
        for (int k = 0; k < LIMITS; ++k)
            limits[k] = LOAD((k == 0 ? within.lower : within.upper) + begin + at);
        const number result =
            updated(value, shading, here, left, right, up, down, limits, flags + begin + at, 1, x, y, parameters, 1);
        STORE(cell, result);
        moved = most(moved, magnitude(here - result));
    }
    return moved;
}
