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

/* For the upwind scheme the unknown is not Z but Z + ln f, f = 1 + p0 x + q0 y, which is level where the surface faces the
 * light. P is the gradient of that in what follows. Then 0 is always among the gradients {P : H(P) <= 0} of surfaces at
 * least as bright as the pixel, so that a value never falls from one cell to the next and back: no loops without end. With
 * dark = 1 - E^2, the square of the sine between normal and light, these gradients are a conic
 *
 *     xx p^2 + 2 xy p q + yy q^2 + 2 x p + 2 y q + free <= 0,        n >= 0
 *
 * whose last three coefficients are proportional to dark: no small difference of large numbers where the surface faces the
 * light.
 */
typedef struct {
    number xx, xy, yy, x, y, free;
} conic;

/* f */
static inline number facing_ray(const number x, const number y, const real *parameters)
{
    return multiply_add(x, parameters[LIGHT_P0], multiply_add(y, parameters[LIGHT_Q0], (number)1));
}

static inline conic lit_gradients(const number dark, const number x, const number y, const real *parameters)
{
    const real light_x = parameters[LIGHT_P0], light_y = parameters[LIGHT_Q0];
    const real inverse_norm = parameters[LIGHT_INVERSE_NORM];
    const number a = (x - light_x) * inverse_norm, b = (y - light_y) * inverse_norm, bright = (number)1 - dark;
    const number per_facing = (number)1 / facing_ray(x, y, parameters), pull = dark * per_facing;
    const number length = pull * per_facing * (1 / (inverse_norm * inverse_norm));
    const conic result = {
        multiply_add(bright * x, x, bright - a * a),
        bright * x * y - a * b,
        multiply_add(bright * y, y, bright - b * b),
        (light_x - x) * pull,
        (light_y - y) * pull,
        -length,
    };
    return result;
}

/* The quadratic in p whose roots are the ends of that set along one axis: bend p^2 - 2 tilt p - rest = 0.
 *
 * Seen from the pixel, the brighter normals form a circular cone around the direction to the light; its two tangent
 * planes that contain the other axis lie at the roots. `spread` is tilt^2 + bend rest.
 */
typedef struct {
    number bend, tilt, rest, spread;
} extent;

static inline extent extent_along(const number dark, const number x, const number y, const int along_y,
                                  const real *parameters)
{
    const number along = along_y ? y : x, across = along_y ? x : y;
    const real light_along = parameters[along_y ? LIGHT_Q0 : LIGHT_P0];
    const real light_across = parameters[along_y ? LIGHT_P0 : LIGHT_Q0];
    const real inverse_norm = parameters[LIGHT_INVERSE_NORM];
    const number f = multiply_add(along, light_along, multiply_add(across, light_across, (number)1));
    const number facing = f * inverse_norm, shift = light_along / f;
    const number apart = multiply_add(across, across, (number)1), ray = multiply_add(along, along, apart);
    /* From the axis and the pixel's ray, the direction along which the surface facing the light does not change. */
    const number radial = multiply_subtract_from(along, shift, ray);
    const number square = multiply_subtract_from((number)1, shift, along + radial);
    const number lit = facing * facing * square;
    const extent result = {multiply_subtract_from(facing * facing, dark, ray), dark * radial, dark * square,
                           dark * multiply_subtract_from(lit, dark, apart)};
    return result;
}

/* The largest p in that set, with `along_y` the largest q, very large where there is none; with `turn` -1 the largest -p
 * or -q. Of two forms of the root the one in which nothing cancels.
 */
static inline number steepest_climb(const number dark, const number x, const number y, const int along_y,
                                    const sided turn, const real *parameters)
{
    const extent ends = extent_along(dark, x, y, along_y, parameters);
    const number square_root = root(most(ends.spread, (number)0)), tilt = turn * ends.tilt;
    const number above = tilt < (number)0 ? ends.rest : tilt + square_root;
    const number below = tilt < (number)0 ? square_root - tilt : ends.bend;
    /* Written so that a NaN stays one. */
    const number climb = below <= (number)0 ? (number)NOWHERE : above / below;
    return ends.spread < (number)0 ? (number)NOWHERE : climb;
}

/* Middle between the largest and the smallest p of that set, or with `along_y` of q; 0 where it is unbounded. */
static inline number middle_gradient(const number brightness, const number x, const number y, const int along_y,
                                     const real *parameters)
{
    const extent ends = extent_along(darkness(brightness), x, y, along_y, parameters);
    return ends.bend > (number)0 ? ends.tilt / ends.bend : (number)0;
}

/* The normal of the conic through P, pointing outwards: where the information at a pixel comes from, reversed. */
static inline slopes outward_normal(const number brightness, const number p, const number q, const number x,
                                    const number y, const real *parameters)
{
    const conic lit = lit_gradients(darkness(brightness), x, y, parameters);
    const slopes normal = {lit.xx * p + lit.xy * q + lit.x, lit.xy * p + lit.yy * q + lit.y};
    return normal;
}

/* n, the sign of which tells the lit side from the other; times f. */
static inline number lit_side(const number p, const number q, const number x, const number y,
                              const real *parameters)
{
    const real light_x = parameters[LIGHT_P0], light_y = parameters[LIGHT_Q0];
    const number f = facing_ray(x, y, parameters);
    const number square = (number)(1 + light_x * light_x + light_y * light_y);
    return multiply_add(f, multiply_add(x - light_x, p, (y - light_y) * q), square);
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
