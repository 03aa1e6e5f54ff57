/* Lambertian surface under a parallel light s = (-p0, -q0, 1): the paper's model.
 *
 *     H(P) = E S - n / k                                                        (7)
 *     S = sqrt(p^2 + q^2 + w^2),  w = 1 + x p + y q,  n = 1 + (x - p0) p + (y - q0) q
 *
 * in normalised image coordinates, where the focal length drops out. `sign` is +1 where the surface leaves the known
 * values away from the camera and -1 where it comes towards it: then the unknown is W = -Z and P changes sign in H.
 * `brightness` is E.
 *
 * For the lanes of one vector; it reads no memory.
 */

/* For the upwind scheme the unknown is not Z but Z + ln f, see light_cone.cl, which nowhere has to fall along a
 * characteristic: else noise could make values fall from one cell to the next and back again, without end.
 */
static inline light_frame light_frame_at(const number x, const number y, const parameter_set *parameters)
{
    return light_frame_of(x, y, parameters->p0, parameters->q0, parameters->inverse_norm);
}

/* The middle of {P : H(P) <= 0} along x, or with `along_y` along y. */
static inline number middle_gradient(const number brightness, const number here, const number x, const number y,
                                     const int along_y, const parameter_set *parameters)
{
    return middle_of_set(darkness(brightness), along_y, light_frame_at(x, y, parameters));
}

/* Its outward normal through P. */
static inline slopes outward_normal(const number brightness, const number here, const number p, const number q,
                                    const number x, const number y, const parameter_set *parameters)
{
    return normal_of_set(darkness(brightness), p, q, light_frame_at(x, y, parameters));
}

/* S */
static inline number surface_norm(const number p, const number q, const number x, const number y)
{
    const number w = multiply_add(x, p, multiply_add(y, q, 1));
    return root(multiply_add(w, w, multiply_add(p, p, q * q)));
}

/* Cosine between normal and light times S, n / k. */
static inline number shade(const number p, const number q, const number x, const number y,
                           const parameter_set *parameters)
{
    const number n = multiply_add(x - parameters->p0, p, multiply_add(y - parameters->q0, q, 1));
    return n * parameters->inverse_norm;
}

/* The parts of H for the Lax-Friedrichs scheme: C = E, N = S, M = n / k. By Cauchy-Schwarz, with no smaller constant,
 *
 *     |dH/dp| <= sigma_x = E sqrt(1 + x^2) + |x - p0| / k
 *
 * whose two terms, but for E, come from the table of the columns.
 */
#define DH_DZ 0

/* sigma_x / (2 dx), and with the axes in the other order sigma_y / (2 dy). */
static inline number viscosity(const number brightness, const axis along, const axis across,
                               const parameter_set *parameters)
{
    return multiply_add(brightness, along.root, along.offset);
}

static inline number regular_part(const number brightness, const number p, const number q, const number x,
                                  const number y, const parameter_set *parameters)
{
    return shade(p, q, x, y, parameters);
}

static inline number norm_part(const number p, const number q, const number x, const number y,
                               const parameter_set *parameters)
{
    return surface_norm(p, q, x, y);
}

static inline number coefficient_of_norm(const number brightness)
{
    return brightness;
}

/* The slope along one axis, of Z or W, at which H is least for a fixed slope along the other. dH/dp is 0 where
 * E (a p + x v) / S = m, with m = (x - p0) / k, a = 1 + x^2 and v = 1 + y q, so that
 *
 *     p* = (m sqrt((a q^2 + v^2) / (a E^2 - m^2)) - x v) / a
 *
 * kept within +-steepest; where a E^2 <= m^2, so that H falls without end, it is `steepest` with the sign of m. `along`
 * and `across` are x and y, or y and x; `light` is the light's slope along the axis.
 */
static inline number argmin_gradient(const number brightness, const number gradient_across, const number along,
                                    const number across, const int along_y, const parameter_set *parameters)
{
    const real light = along_y ? parameters->q0 : parameters->p0;
    const real steepest = parameters->steepest;
    const number q = parameters->sign * gradient_across;
    const number m = (along - light) * parameters->inverse_norm;
    const number a = multiply_add(along, along, 1);
    const number v = multiply_add(across, q, 1);
    const number excess = multiply_add(a * brightness, brightness, -(m * m));
    const number t = m * root(multiply_add(a * q, q, v * v) / most(excess, 0));
    const number slope = excess > 0 ? (t - along * v) / a : choose(m < 0, -steepest, steepest);
    return parameters->sign * most(least(slope, steepest), -steepest);
}

/* dH/dp, or with `along_y` dH/dq. */
static inline number hamiltonian_slope(const number brightness, const number p, const number q, const number x,
                                       const number y, const int along_y, const parameter_set *parameters)
{
    const number along = along_y ? y : x, slope = along_y ? q : p;
    const real light = along_y ? parameters->q0 : parameters->p0;
    const number w = multiply_add(x, p, multiply_add(y, q, 1));
    const number rise = brightness * multiply_add(along, w, slope) / surface_norm(p, q, x, y);
    return rise - (along - light) * parameters->inverse_norm;
}

/* The forward model, eq. (6): E = n / (k S). */
static inline number rendered(const number log_depth, const number p, const number q, const number x, const number y,
                              const parameter_set *parameters)
{
    return shade(p, q, x, y, parameters) / surface_norm(p, q, x, y);
}
