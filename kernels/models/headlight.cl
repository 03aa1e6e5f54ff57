/* A light at the optical centre whose fall-off has been removed from the photograph: only the angle theta between surface
 * and ray tells.
 *
 *     I = kappa c(theta),    cos theta = 1 / (R S),    R^2 = 1 + x^2 + y^2
 *
 * In `brightness` stands E = cos theta, found on the host for any material of which a brightness belongs to one angle. That
 * would make E S - 1 / R = 0 of parallel_light.cl, with a light along the ray of each pixel: p0 = x, q0 = y, k = R. But a
 * surface that faces such a light, the sphere around the camera, is curved in Z, and the differences of a scheme would not
 * close around it. So here Z stands for the log distance ln (z R), and P for its gradient, which is 0 on that sphere:
 *
 *     H(P) = E N - 1,    N = R S = sqrt(1 + R^2 P' A P),    A = I + (x, y)(x, y)'
 *
 * The surface leaves the known values in distance from the camera. H does not depend on the sign of P: W = -Z has the same.
 */

static inline number square_ray(const number x, const number y)
{
    return multiply_add(x, x, multiply_add(y, y, (number)1));
}

/* The ellipse {P : H(P) <= 0}, as in light_cone.cl; the light needs no direction. */
typedef struct {
    number xx, xy, yy, x, y, free;
} conic;
typedef struct {
    number x, y;
} sight;

static inline sight sight_at(const number x, const number y, const parameter_set *parameters)
{
    const sight result = {x, y};
    return result;
}

static inline conic lit_gradients(const number dark, const sight at)
{
    const number x = at.x, y = at.y, scale = ((number)1 - dark) * square_ray(x, y), none = (number)0;
    const conic result = {multiply_add(scale * x, x, scale), scale * x * y, multiply_add(scale * y, y, scale), none, none,
                          -dark};
    return result;
}

/* The largest p in it, or q, which is also the largest -p or -q. */
static inline number steepest_climb(const number dark, const int along_y, const sided turn, const sight at)
{
    const number along = along_y ? at.y : at.x, across = along_y ? at.x : at.y;
    return root(dark / ((number)1 - dark) * multiply_add(across, across, (number)1)) / square_ray(along, across);
}

/* Its centre. */
static inline number middle_gradient(const number brightness, const number here, const number x, const number y,
                                     const int along_y, const parameter_set *parameters)
{
    return (number)0;
}

/* Its normal through P, A P. */
static inline slopes outward_normal(const number brightness, const number here, const number p, const number q,
                                    const number x, const number y, const parameter_set *parameters)
{
    const number radial = multiply_add(x, p, y * q);
    const slopes normal = {multiply_add(x, radial, p), multiply_add(y, radial, q)};
    return normal;
}

/* All that the camera sees is lit. */
static inline number lit_side(const number p, const number q, const sight at)
{
    return (number)1;
}

/* The parts of H for the Lax-Friedrichs scheme: |dH/dp| <= sigma_x = E R sqrt(1 + x^2). */
#define PULL 0

static inline number viscosity(const number brightness, const axis along, const axis across, const parameter_set *parameters)
{
    return brightness * root(square_ray(along.coordinate, across.coordinate)) * along.root;
}

static inline number regular_part(const number brightness, const number p, const number q, const number x,
                                  const number y, const parameter_set *parameters)
{
    return (number)1;
}

/* N */
static inline number norm_part(const number p, const number q, const number x, const number y, const parameter_set *parameters)
{
    const number radial = multiply_add(x, p, y * q);
    const number square = multiply_add(radial, radial, multiply_add(p, p, q * q));
    return root(multiply_add(square_ray(x, y), square, (number)1));
}

static inline number factor_of_norm(const number brightness)
{
    return brightness;
}

/* The slope along one axis at which N is smallest, for a fixed slope along the other. */
static inline number least_gradient(const number brightness, const number gradient_across, const number along,
                                    const number across, const int along_y, const parameter_set *parameters)
{
    return -along * across * gradient_across / multiply_add(along, along, (number)1);
}

/* The forward model, from the gradient of ln z: that of ln R is (x, y) / R^2. */
static inline number rendered(const number log_depth, const number p, const number q, const number x, const number y,
                              const parameter_set *parameters)
{
    const number ray = square_ray(x, y);
    const number secant = norm_part(p + x / ray, q + y / ray, x, y, parameters);
    return exponential(-dimming(multiply_add(secant, secant, (number)-1), parameters));
}
