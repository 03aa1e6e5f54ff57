/* A light at the optical centre whose fall-off with distance has been divided out of the photograph: the brightness
 * depends only on the angle theta between the normal and the ray.
 *
 *     I = kappa c(theta),    cos theta = 1 / (R S),    R^2 = 1 + x^2 + y^2
 *
 * `brightness` is E = cos theta, found on the host for any material that has one angle for each brightness. That would
 * make it E S - 1 / R = 0 of parallel_light.cl, with a light along the ray of each pixel: p0 = x, q0 = y, k = R. But a
 * surface that faces such a light, the sphere around the camera, is curved in Z, and the differences of a scheme do not
 * vanish on it. So here Z is the logarithm of the distance, ln (z R), and P its gradient, which is 0 on that sphere:
 *
 *     H(P) = E N - 1,    N = R S = sqrt(1 + R^2 P' A P),    A = I + (x, y)(x, y)'
 *
 * Known values are left in distance from the camera. H does not depend on the sign of P, and is the same for W = -Z.
 *
 * For the lanes of one vector; it reads no memory.
 */
static inline number square_ray(const number x, const number y)
{
    return multiply_add(x, x, multiply_add(y, y, 1));
}

/* As in light_cone.cl: here the conic is an ellipse around 0, and the light needs no direction. */
typedef struct {
    number xx, xy, yy, x, y, free;
} conic;
typedef struct {
    number x, y;
} light_frame;

static inline light_frame light_frame_at(const number x, const number y, const parameter_set *parameters)
{
    const light_frame result = {x, y};
    return result;
}

/* {P : H(P) <= 0}, with dark = 1 - E^2: (1 - dark) R^2 P' A P <= dark. */
static inline conic sublevel_set(const number dark, const light_frame at)
{
    const number x = at.x, y = at.y, scale = (1 - dark) * square_ray(x, y), none = 0;
    const conic result = {
        multiply_add(scale * x, x, scale), scale * x * y, multiply_add(scale * y, y, scale), none, none, -dark,
    };
    return result;
}

/* max p over that set, or with `along_y` max q; it is also the largest -p or -q. */
static inline number steepest_climb(const number dark, const int along_y, const sided turn, const light_frame at)
{
    const number along = along_y ? at.y : at.x, across = along_y ? at.x : at.y;
    return root(dark / (1 - dark) * multiply_add(across, across, 1)) / square_ray(along, across);
}

/* Its centre. */
static inline number middle_gradient(const number brightness, const number here, const number x, const number y,
                                     const int along_y, const parameter_set *parameters)
{
    return 0;
}

/* Its outward normal through P, A P. */
static inline slopes outward_normal(const number brightness, const number here, const number p, const number q,
                                    const number x, const number y, const parameter_set *parameters)
{
    const number radial = multiply_add(x, p, y * q);
    const slopes normal = {multiply_add(x, radial, p), multiply_add(y, radial, q)};
    return normal;
}

/* As in light_cone.cl: above 0, since all that the camera sees is lit. */
static inline number lit_side(const number p, const number q, const light_frame at)
{
    return 1;
}

/* The parts of H for the Lax-Friedrichs scheme: C = E, N as above, M = 1. */
#define DH_DZ 0

/* |dH/dp| <= sigma_x = E R sqrt(1 + x^2): sigma_x / (2 dx), and with the axes in the other order sigma_y / (2 dy). */
static inline number viscosity(const number brightness, const axis along, const axis across,
                               const parameter_set *parameters)
{
    return brightness * root(square_ray(along.coordinate, across.coordinate)) * along.root;
}

static inline number regular_part(const number brightness, const number p, const number q, const number x,
                                  const number y, const parameter_set *parameters)
{
    return 1;
}

/* N */
static inline number norm_part(const number p, const number q, const number x, const number y,
                               const parameter_set *parameters)
{
    const number radial = multiply_add(x, p, y * q);
    const number square = multiply_add(radial, radial, multiply_add(p, p, q * q));
    return root(multiply_add(square_ray(x, y), square, 1));
}

static inline number coefficient_of_norm(const number brightness)
{
    return brightness;
}

/* The p at which H is least for fixed q: -x y q / (1 + x^2); with `along_y` the q for fixed p. */
static inline number argmin_gradient(const number brightness, const number gradient_across, const number along,
                                    const number across, const int along_y, const parameter_set *parameters)
{
    return -along * across * gradient_across / multiply_add(along, along, 1);
}

/* The forward model: I = kappa c, t^2 = N^2 - 1. To the gradient of ln z that of ln R is added, (x, y) / R^2. */
static inline number rendered(const number log_depth, const number p, const number q, const number x, const number y,
                              const parameter_set *parameters)
{
    const number ray = square_ray(x, y);
    const number secant = norm_part(p + x / ray, q + y / ray, x, y, parameters);
    return exponential(-minus_log_c(multiply_add(secant, secant, -1), parameters));
}
