/* Lambertian surface under a parallel light s = (-p0, -q0, 1): the paper's model.
 *
 *     H(P) = E S - n / k                                                        (7)
 *     S = sqrt(p^2 + q^2 + w^2),  w = 1 + x p + y q,  n = 1 + (x - p0) p + (y - q0) q
 *
 * in normalised image coordinates, where the focal length drops out. `sign` is +1 where the surface leaves the known
 * values away from the camera and -1 where it comes towards it: then the unknown is W = -Z and P changes sign in H.
 */

/* For the upwind scheme the unknown is not Z but Z + ln f, as in light_cone.cl: so a value never falls from one cell to the
 * next and back, and there are no loops without end.
 */
static inline sight sight_at(const number x, const number y, const parameter_set *parameters)
{
    return sight_of(x, y, parameters->p0, parameters->q0, parameters->inverse_norm);
}

static inline number middle_gradient(const number brightness, const number here, const number x, const number y,
                                     const int along_y, const parameter_set *parameters)
{
    return middle_of_set(darkness(brightness), along_y, sight_at(x, y, parameters));
}

static inline slopes outward_normal(const number brightness, const number here, const number p, const number q,
                                    const number x, const number y, const parameter_set *parameters)
{
    return normal_of_set(darkness(brightness), p, q, sight_at(x, y, parameters));
}

/* S */
static inline number surface_norm(const number p, const number q, const number x, const number y)
{
    const number w = multiply_add(x, p, multiply_add(y, q, (number)1));
    return root(multiply_add(w, w, multiply_add(p, p, q * q)));
}

/* Cosine between normal and light times S, n / k. */
static inline number shade(const number p, const number q, const number x, const number y,
                           const parameter_set *parameters)
{
    const number n = multiply_add(x - parameters->p0, p, multiply_add(y - parameters->q0, q, (number)1));
    return n * parameters->inverse_norm;
}

/* The parts of H for the Lax-Friedrichs scheme: H = E S - n / k. By Cauchy-Schwarz, tightly and for each pixel,
 *
 *     |dH/dp| <= sigma_x = E sqrt(1 + x^2) + |x - p0| / k
 *
 * whose two terms depend on the column alone, but for E.
 */
#define PULL 0

/* sigma_x / (2 dx), and with the axes in the other order that of y. */
static inline number viscosity(const number brightness, const axis along, const axis across, const parameter_set *parameters)
{
    return multiply_add(brightness, along.root, along.offset);
}

static inline number regular_part(const number brightness, const number p, const number q, const number x,
                                  const number y, const parameter_set *parameters)
{
    return shade(p, q, x, y, parameters);
}

static inline number norm_part(const number p, const number q, const number x, const number y, const parameter_set *parameters)
{
    return surface_norm(p, q, x, y);
}

static inline number factor_of_norm(const number brightness)
{
    return brightness;
}

/* The slope along one axis, of Z or W, at which H is smallest for a fixed slope along the other.
 *
 * With m = (x - p0) / k, a = 1 + x^2 and b = x (1 + y q), dH/dp = 0 where E (a p + b) / S = m. Where H falls for ever it
 * is the steepest slope. `along` and `across` are x and y, or y and x; `light` is the light's slope along the axis.
 */
static inline number least_gradient(const number brightness, const number gradient_across, const number along,
                                    const number across, const int along_y, const parameter_set *parameters)
{
    const real light = along_y ? parameters->q0 : parameters->p0;
    const real steepest = parameters->steepest;
    const number q = parameters->sign * gradient_across;
    const number m = (along - light) * parameters->inverse_norm;
    const number a = multiply_add(along, along, (number)1);
    const number v = multiply_add(across, q, (number)1);
    const number excess = multiply_add(a * brightness, brightness, -(m * m));
    const number t = m * root(multiply_add(a * q, q, v * v) / most(excess, (number)0));
    const number slope = excess > (number)0 ? (t - along * v) / a : (m < (number)0 ? (number)(-steepest) : (number)steepest);
    return parameters->sign * most(least(slope, (number)steepest), (number)(-steepest));
}

/* The forward model, eq. (6). */
static inline number rendered(const number log_depth, const number p, const number q, const number x, const number y,
                              const parameter_set *parameters)
{
    return shade(p, q, x, y, parameters) / surface_norm(p, q, x, y);
}
