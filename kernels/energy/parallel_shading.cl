/* The brightness of any material under a parallel light s = (-p0, -q0, 1), and its derivatives, for the energy:
 *
 *     R = c(lit, seen, between),   lit = n / (k S),   seen = 1 / (|R| S),   between = f / (k |R|)
 *     n = 1 + (x - p0) p + (y - q0) q,   w = 1 + x p + y q,   S^2 = p^2 + q^2 + w^2,   f = 1 + p0 x + q0 y
 *
 * with |R|^2 = 1 + x^2 + y^2 of the ray. By the chain rule, as dS/dp = (p + x w) / S:
 *
 *     d lit / dp = (x - p0) / (k S) - lit (p + x w) / S^2,    d seen / dp = -seen (p + x w) / S^2
 *
 * It reads no memory but the parameters.
 */

/* R; writes its derivatives by Z, p and q. */
static inline number shade(const number log_depth, const number p, const number q, const number x, const number y,
                           const parameter_set *parameters, number *slopes)
{
    const number light_x = x - parameters->p0, light_y = y - parameters->q0;
    const number w = multiply_add(x, p, multiply_add(y, q, 1));
    const number inverse_square = 1 / multiply_add(w, w, multiply_add(p, p, q * q));
    const number inverse_norm = root(inverse_square);
    const number inverse_ray = 1 / root(multiply_add(x, x, multiply_add(y, y, 1)));
    const number scale = inverse_norm * parameters->inverse_norm;
    const number lit = multiply_add(light_x, p, multiply_add(light_y, q, 1)) * scale;
    const number seen = inverse_ray * inverse_norm;
    const number facing = multiply_add(x, parameters->p0, multiply_add(y, parameters->q0, 1));
    number by[3];
    const number result = returned_slopes(lit, seen, facing * inverse_ray * parameters->inverse_norm, parameters, by);
    /* Half the logarithmic derivative of S^2. */
    const number by_p = multiply_add(x, w, p) * inverse_square, by_q = multiply_add(y, w, q) * inverse_square;
    const number shrinking = multiply_add(by[0], lit, by[1] * seen);
    slopes[0] = 0;
    slopes[1] = multiply_add(by[0] * scale, light_x, -shrinking * by_p);
    slopes[2] = multiply_add(by[0] * scale, light_y, -shrinking * by_q);
    return result;
}
