/* The brightness of any material under a lamp at O, and its derivatives, for the energy:
 *
 *     R = c(lit, seen, between) / rho^2,    L = O - z (x, y, 1),    rho = |L|,    z = exp Z
 *     lit = N.L / (S rho),   N = (p, q, -w),   seen = 1 / (|R| S),   between = -(x, y, 1).L / (|R| rho)
 *
 * Without fall-off, where `fading` is 0, the division by rho^2 is left out. w, S and |R| are as in parallel_shading.cl.
 * By the chain rule, as N.(x, y, 1) = -1, and with rho' = d ln rho / dZ:
 *
 *     d lit / dp = (L_x - x L_z) / (S rho) - lit (p + x w) / S^2
 *     d lit / dZ = z / (S rho) - lit rho',      d between / dZ = z |R| / rho - between rho'
 *
 * Both of the latter are 0 for a lamp at the camera. The image is divided by the lamp's gain on the host. It reads no
 * memory but the parameters.
 */

/* R; writes its derivatives by Z, p and q. */
static inline number shade(const number log_depth, const number p, const number q, const number x, const number y,
                           const parameter_set *parameters, number *slopes)
{
    const number z = exponential(log_depth);
    const number right = fnma(z, x, parameters->lamp_x), below = fnma(z, y, parameters->lamp_y);
    const number ahead = parameters->lamp_z - z;
    const number w = multiply_add(x, p, multiply_add(y, q, 1));
    const number inverse_square = 1 / multiply_add(w, w, multiply_add(p, p, q * q));
    const number inverse_norm = root(inverse_square);
    const number ray = root(multiply_add(x, x, multiply_add(y, y, 1)));
    const number inverse_distance =
        1 / root(multiply_add(right, right, multiply_add(below, below, ahead * ahead)));
    const number scale = inverse_norm * inverse_distance;
    const number lit = multiply_add(p, right, multiply_add(q, below, -w * ahead)) * scale;
    const number seen = inverse_norm / ray;
    const number along = -multiply_add(x, right, multiply_add(y, below, ahead));
    const number between = along / ray * inverse_distance;
    number by[3];
    const number returned = returned_slopes(lit, seen, between, parameters, by);
    const number rise = z * along * inverse_distance * inverse_distance; /* rho' */
    const number lit_by_depth = fnma(lit, rise, z * scale);
    const number between_by_depth = fnma(between, rise, z * ray * inverse_distance);
    const number by_p = multiply_add(x, w, p) * inverse_square, by_q = multiply_add(y, w, q) * inverse_square;
    const number shrinking = multiply_add(by[0], lit, by[1] * seen);
    const number fade = choose(parameters->fading > 0, inverse_distance * inverse_distance, 1);
    const number turning = multiply_add(by[0], lit_by_depth, by[2] * between_by_depth);
    slopes[0] = fade * fnma(2 * parameters->fading * returned, rise, turning);
    slopes[1] = fade * multiply_add(by[0] * scale, fnma(x, ahead, right), -shrinking * by_p);
    slopes[2] = fade * multiply_add(by[0] * scale, fnma(y, ahead, below), -shrinking * by_q);
    return returned * fade;
}
