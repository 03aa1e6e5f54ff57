/* Candidate value of a cell by the Lax-Friedrichs scheme, eq. (11) with its sign put right:
 *
 *     Z = [ -H(p, q) + sigma_x (Z_r + Z_l) / (2 dx) + sigma_y (Z_d + Z_u) / (2 dy) ] / (sigma_x / dx + sigma_y / dy)
 *
 * with central differences p and q. By Cauchy-Schwarz, tightly and for each pixel,
 *
 *     |dH/dp| <= sigma_x = E sqrt(1 + x^2) + |x - p0| / k,   sigma_y likewise,
 *
 * so that Z does not fall where a neighbour rises: the scheme is monotone. The two terms of sigma_x / (2 dx) depend on
 * the column alone and come from a table, as do those of sigma_y from the row: three square roots and a division fewer.
 *
 * The order of the operations keeps the way from Z_l and Z_u to the result short, since in a sweep every cell waits for
 * these two: S is the last thing to be known.
 */
typedef struct {
    number coordinate; /* x or y                                         */
    number root;       /* sqrt(1 + x^2) / (2 dx), likewise for y         */
    number offset;     /* |x - p0| / (2 k dx), likewise for y            */
} axis;

static inline number candidate(const number brightness, /* E                                */
                               const number p,          /* dZ/dx, also where W is solved for */
                               const number q,          /* dZ/dy                            */
                               const number sum_x,      /* Z_r + Z_l, or of W               */
                               const number sum_y,      /* Z_d + Z_u                        */
                               const axis x, const axis y, const real *parameters)
{
    const number weight_x = multiply_add(brightness, x.root, x.offset);
    const number weight_y = multiply_add(brightness, y.root, y.offset);
    const number scale = (number)0.5f / (weight_x + weight_y);
    const number regular = multiply_add(
        weight_x, sum_x, multiply_add(weight_y, sum_y, shade(p, q, x.coordinate, y.coordinate, parameters)));
    const number norm = surface_norm(p, q, x.coordinate, y.coordinate);
    return multiply_subtract_from(regular * scale, brightness * scale, norm);
}
