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

/* {P : H(P) <= 0}, the gradients of surfaces that are at least as bright as the pixel, is a conic
 *
 *     xx p^2 + 2 xy p q + yy q^2 + 2 x p + 2 y q + free <= 0,        n >= 0
 *
 * whose coefficients are linear in 1 - E^2, the square of the sine between normal and light: no small difference of
 * large numbers where the surface faces the light. Of `x` and `y` the sign is that of the direction one looks in, and of
 * Z or W; the same goes for `light_x` and `light_y`, the light's slopes p0 and q0.
 */
typedef struct {
    number xx, xy, yy, x, y, free;
} conic;

static inline conic lit_gradients(const number dark, /* 1 - E^2 */
                                  const number x, const number y, const real light_x, const real light_y,
                                  const real *parameters)
{
    const real inverse_norm = parameters[LIGHT_INVERSE_NORM], facing = inverse_norm * inverse_norm;
    const number a = (x - light_x) * inverse_norm, b = (y - light_y) * inverse_norm, bright = (number)1 - dark;
    const conic result = {
        multiply_add(bright * x, x, bright - a * a),
        bright * x * y - a * b,
        multiply_add(bright * y, y, bright - b * b),
        bright * x - a * inverse_norm,
        bright * y - b * inverse_norm,
        ((number)1 - facing) - dark,
    };
    return result;
}

/* The largest p in that set, infinite where there is none.
 *
 * Seen from the pixel, the brighter normals form a circular cone around the direction to the light; its two tangent
 * planes that contain the y axis lie where a quadratic in p vanishes. Of two forms of the root that one is taken in which
 * nothing cancels.
 */
static inline number steepest_climb(const number dark, const number along, const number across,
                                    const number light_along, const number light_across, const real *parameters)
{
    const number toward = -light_along * parameters[LIGHT_INVERSE_NORM];
    const number facing =
        multiply_add(along, light_along, multiply_add(across, light_across, (number)1)) * parameters[LIGHT_INVERSE_NORM];
    const number rest = multiply_add(across, across, (number)1), ray = multiply_add(along, along, rest);
    const number tilt = multiply_add(facing, toward, dark * along);
    const number bend = multiply_subtract_from(facing * facing, dark, ray);
    const number lit = multiply_add(facing, multiply_add((number)2 * toward, along, facing), ray * toward * toward);
    const number spread = dark * multiply_subtract_from(lit, dark, rest);
    const number square_root = root(most(spread, (number)0));
    const number upwards = (tilt + square_root) / bend;
    const number downwards = multiply_subtract_from(dark, toward, toward) / (square_root - tilt);
    /* Written so that a NaN stays one. */
    const number unbounded = (number)NOWHERE;
    const number climb = tilt < (number)0 ? downwards : (bend <= (number)0 ? unbounded : upwards);
    return spread < (number)0 ? unbounded : climb;
}

/* n, the sign of which tells the lit side from the other. */
static inline number lit_side(const number p, const number q, const number x, const number y, const real light_x,
                              const real light_y)
{
    return multiply_add(x - light_x, p, multiply_add(y - light_y, q, (number)1));
}

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

/* The parts of H for the Lax-Friedrichs scheme: H = E S - n / k. By Cauchy-Schwarz, tightly and for each pixel,
 *
 *     |dH/dp| <= sigma_x = E sqrt(1 + x^2) + |x - p0| / k
 *
 * whose two terms depend on the column alone, but for E.
 */
#define PULL 0

/* sigma_x / (2 dx), and with the axes in the other order that of y. */
static inline number viscosity(const number brightness, const axis along, const axis across, const real *parameters)
{
    return multiply_add(brightness, along.root, along.offset);
}

static inline number regular_part(const number brightness, const number p, const number q, const number x,
                                  const number y, const real *parameters)
{
    return shade(p, q, x, y, parameters);
}

static inline number norm_part(const number p, const number q, const number x, const number y, const real *parameters)
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
                                    const number across, const int along_y, const real *parameters)
{
    const real light = parameters[along_y ? LIGHT_Q0 : LIGHT_P0];
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

/* The forward model, eq. (6). */
static inline number rendered(const number log_depth, const number p, const number q, const number x, const number y,
                              const real *parameters)
{
    return shade(p, q, x, y, parameters) / surface_norm(p, q, x, y);
}
