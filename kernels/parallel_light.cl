/* Lambertian surface under a parallel light s = (-p0, -q0, 1): the paper's model.
 *
 *     H(P) = E S - n / k                                                        (7)
 *     S = sqrt(p^2 + q^2 + w^2),  w = 1 + x p + y q,  n = 1 + (x - p0) p + (y - q0) q
 *
 * in normalised image coordinates, where the focal length drops out. `sign` is +1 where the surface leaves the known
 * values away from the camera and -1 where it comes towards it: then the unknown is W = -Z and P changes sign in H.
 */
#define LIGHT_P0 (FIRST_MODEL_PARAMETER + 0)
#define LIGHT_Q0 (FIRST_MODEL_PARAMETER + 1)
#define LIGHT_INVERSE_NORM (FIRST_MODEL_PARAMETER + 2) /* 1 / k, k = sqrt(1 + p0^2 + q0^2) */
#define SURFACE_SIGN (FIRST_MODEL_PARAMETER + 3)

/* S */
static inline number surface_norm(const number p, const number q, const number x, const number y)
{
    const number w = multiply_add(x, p, multiply_add(y, q, (number)1));
    return root(multiply_add(w, w, multiply_add(p, p, q * q)));
}

/* Cosine between normal and light times S, n / k. */
static inline number shade(const number p, const number q, const number x, const number y,
                           const real *parameters)
{
    const number n = multiply_add(x - parameters[LIGHT_P0], p, multiply_add(y - parameters[LIGHT_Q0], q, (number)1));
    return n * parameters[LIGHT_INVERSE_NORM];
}

/* The slope along one axis, of Z or W, at which H is smallest for a fixed slope along the other.
 *
 * With m = (x - p0) / k, a = 1 + x^2 and b = x (1 + y q), dH/dp = 0 where E (a p + b) / S = m. Where H falls for ever it
 * is the steepest slope. `along` and `across` are x and y, or y and x; `light` is the light's slope along the axis.
 */
static inline number least_gradient(const number brightness, const number gradient_across, const number along,
                                    const number across, const real light, const real *parameters)
{
    const real steepest = parameters[STEEPEST];
    const number q = parameters[SURFACE_SIGN] * gradient_across;
    const number m = (along - light) * parameters[LIGHT_INVERSE_NORM];
    const number a = multiply_add(along, along, (number)1);
    const number v = multiply_add(across, q, (number)1);
    const number excess = multiply_add(a * brightness, brightness, -(m * m));
    const number t = m * root(multiply_add(a * q, q, v * v) / most(excess, (number)0));
    const number slope = excess > (number)0 ? (t - along * v) / a : (m < (number)0 ? (number)(-steepest) : (number)steepest);
    return parameters[SURFACE_SIGN] * most(least(slope, (number)steepest), (number)(-steepest));
}
