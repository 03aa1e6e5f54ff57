/* One Lax-Friedrichs sweep as anyone would write it: the yardstick that the kernels are measured against.
 *
 * The arithmetic of kernels/models/parallel_light.cl, lax_friedrichs.cl and cell.cl in the same order, so that the results are
 * those of kernels/orderings/lexicographic.cl but for the rounding of multiply-adds. Pixels on the frame are known and not visited; a brightness of NaN
 * marks further pixels that keep their value, since no comparison accepts what comes of it.
 */
#include <tgmath.h>

void sweep(REAL *restrict log_depth,        /* Z or W = -Z, shape (height, width), changed in place             */
           const REAL *restrict brightness, /* E, same shape                                                   */
           const REAL *restrict x_table,    /* coordinate, root and offset of each column, shape (3, width)    */
           const REAL *restrict y_table,    /* the same of each row, shape (3, height)                         */
           const REAL *restrict parameters, /* COMMON of persfs_cl/_cl/parameters.py, then p0, q0 and inverse_norm      */
           const int height, const int width,
           const int leftwards,             /* 1: columns from the right                                       */
           const int upwards)               /* 1: rows from the bottom                                         */
{
    const REAL sign = parameters[5];
    const REAL to_p = sign * parameters[0], to_q = sign * parameters[1];
    const REAL step_x = parameters[2], step_y = parameters[3];
    const REAL p0 = parameters[6], q0 = parameters[7], inverse_norm = parameters[8];

    for (int i = 1; i < height - 1; ++i) {
        const int row = upwards ? height - 1 - i : i;
        const REAL y = y_table[row], root_y = y_table[height + row], offset_y = y_table[2 * height + row];
        for (int j = 1; j < width - 1; ++j) {
            const int column = leftwards ? width - 1 - j : j;
            const REAL x = x_table[column], root_x = x_table[width + column], offset_x = x_table[2 * width + column];
            REAL *const cell = log_depth + (long)row * width + column;
            const REAL e = brightness[(long)row * width + column];
            const REAL left = cell[-1], right = cell[1], up = cell[-width], down = cell[width];

            const REAL p = (right - left) * to_p, q = (down - up) * to_q;
            const REAL weight_x = e * root_x + offset_x;
            const REAL weight_y = e * root_y + offset_y;
            const REAL scale = (REAL)0.5 / (weight_x + weight_y);
            const REAL shade = ((x - p0) * p + ((y - q0) * q + 1)) * inverse_norm;
            const REAL regular = weight_x * (right + left) + (weight_y * (down + up) + shade);
            const REAL w = x * p + (y * q + 1);
            const REAL norm = sqrt(w * w + (p * p + q * q));
            const REAL value = regular * scale - e * scale * norm;

            const REAL highest_x = (left < right ? left : right) + step_x;
            const REAL highest_y = (up < down ? up : down) + step_y;
            const REAL highest = highest_x < highest_y ? highest_x : highest_y;
            const REAL bounded = highest < value ? highest : value;
            *cell = bounded < *cell ? bounded : *cell;
        }
    }
}
