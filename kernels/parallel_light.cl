/* Lambertian surface under a parallel light s = (-p0, -q0, 1): the paper's model.
 *
 *     H(P) = E S - n / k                                                        (7)
 *     S = sqrt(p^2 + q^2 + w^2),  w = 1 + x p + y q,  n = 1 + (x - p0) p + (y - q0) q
 *
 * in normalised image coordinates, where the focal length drops out. By Cauchy-Schwarz, tightly and for each pixel,
 *
 *     |dH/dp| <= sigma_x = E sqrt(1 + x^2) + |x - p0| / k,   sigma_y likewise.
 *
 * `sign` is +1 where the surface leaves the known values away from the camera and -1 where it comes towards it: then
 * the unknown is W = -Z and P changes sign in H.
 */
#define LIGHT_P0 (FIRST_MODEL_PARAMETER + 0)
#define LIGHT_Q0 (FIRST_MODEL_PARAMETER + 1)
#define LIGHT_INVERSE_NORM (FIRST_MODEL_PARAMETER + 2) /* 1 / k, k = sqrt(1 + p0^2 + q0^2) */
#define SURFACE_SIGN (FIRST_MODEL_PARAMETER + 3)

static inline real surface_norm(const real p, const real q, const real w)
{
    return sqrt(multiply_add(p, p, multiply_add(q, q, w * w)));
}

/* Cosine between normal and light times S, n / k. */
static inline real shade(const real p, const real q, const real x, const real y, __constant const real *parameters)
{
    const real n = multiply_add(x - parameters[LIGHT_P0], p, multiply_add(y - parameters[LIGHT_Q0], q, (real)1));
    return n * parameters[LIGHT_INVERSE_NORM];
}

static inline real hamiltonian(const real brightness, const real gradient_x, const real gradient_y, const real x,
                               const real y, __constant const real *parameters)
{
    const real p = parameters[SURFACE_SIGN] * gradient_x;
    const real q = parameters[SURFACE_SIGN] * gradient_y;
    const real w = multiply_add(x, p, multiply_add(y, q, (real)1));
    return multiply_add(brightness, surface_norm(p, q, w), -shade(p, q, x, y, parameters));
}

/* sigma along one axis; `coordinate` is x or y, `slope` the light's p0 or q0. */
static inline real viscosity(const real brightness, const real coordinate, const real slope,
                             __constant const real *parameters)
{
    return multiply_add(brightness, sqrt(multiply_add(coordinate, coordinate, (real)1)),
                        fabs(coordinate - slope) * parameters[LIGHT_INVERSE_NORM]);
}

static inline real viscosity_x(const real brightness, const real x, __constant const real *parameters)
{
    return viscosity(brightness, x, parameters[LIGHT_P0], parameters);
}

static inline real viscosity_y(const real brightness, const real y, __constant const real *parameters)
{
    return viscosity(brightness, y, parameters[LIGHT_Q0], parameters);
}

/* The p in [-steepest, steepest] at which H(p, q) is smallest, for fixed q. With m = (x - p0) / k, a = 1 + x^2 and
 * b = x (1 + y q), dH/dp = 0 where E (a p + b) / S = m. By symmetry the same function serves for q.
 */
static inline real least_slope(const real brightness, const real q, const real x, const real y, const real slope,
                               const real steepest, __constant const real *parameters)
{
    const real m = (x - slope) * parameters[LIGHT_INVERSE_NORM];
    const real a = multiply_add(x, x, (real)1);
    const real v = multiply_add(y, q, (real)1);
    const real excess = multiply_add(a * brightness, brightness, -m * m);
    if (excess <= 0) /* H falls for ever */
        return copysign(steepest, m);
    const real t = m * sqrt(multiply_add(a * q, q, v * v) / excess);
    return fmin(fmax((t - x * v) / a, -steepest), steepest);
}

static inline real least_gradient_x(const real brightness, const real gradient_y, const real x, const real y,
                                    const real steepest, __constant const real *parameters)
{
    const real sign = parameters[SURFACE_SIGN];
    return sign * least_slope(brightness, sign * gradient_y, x, y, parameters[LIGHT_P0], steepest, parameters);
}

static inline real least_gradient_y(const real brightness, const real gradient_x, const real x, const real y,
                                    const real steepest, __constant const real *parameters)
{
    const real sign = parameters[SURFACE_SIGN];
    return sign * least_slope(brightness, sign * gradient_x, y, x, parameters[LIGHT_Q0], steepest, parameters);
}

/* Forward model, E = n / (k S)                                                                               (6) */
static inline real reflectance_map(const real p, const real q, const real x, const real y,
                                   __constant const real *parameters)
{
    const real w = multiply_add(x, p, multiply_add(y, q, (real)1));
    return shade(p, q, x, y, parameters) / surface_norm(p, q, w);
}
