/* A light at the optical centre that fades with the square of the distance: a flash, the lamp of an endoscope.
 *
 *     I = kappa c(theta) / r^2,    r = z R,    cos theta = 1 / (R S),    R^2 = 1 + x^2 + y^2
 *
 * `brightness` is F = I R^2 / kappa, so that F exp(2 Z) = c. The material gives -ln c by t^2, t = tan theta, and
 *
 *     H(Z, P) = 2 Z + ln F - ln c(theta(P))
 *
 * rises with Z: there is one solution, without values on the boundary. Gradients of one t are an ellipse around P_c:
 *
 *     t^2 = R^2 (P - P_c)' A (P - P_c),    P_c = -(x, y) / R^2,    A = I + (x, y)(x, y)'
 *
 * For the lanes of one vector; it reads no memory.
 */
#define DH_DZ 2

/* t^2 from the gradient, by R^2 (P - P_c) = R^2 P + (x, y), in which nothing cancels. */
static inline number square_tangent(const number p, const number q, const number x, const number y)
{
    const number ray = multiply_add(x, x, multiply_add(y, y, 1));
    const number along_x = multiply_add(p, ray, x), along_y = multiply_add(q, ray, y);
    const number radial = multiply_add(x, along_x, y * along_y);
    return multiply_add(radial, radial, multiply_add(along_x, along_x, along_y * along_y)) / ray;
}

/* |dH/dp| <= sigma_x = max |d ln c / dt| R sqrt(1 + x^2): sigma_x / (2 dx), and with the axes in the other order that
 * of y.
 */
static inline number viscosity(const number brightness, const axis along, const axis across,
                               const parameter_set *parameters)
{
    const number ray = multiply_add(along.coordinate, along.coordinate,
                                    multiply_add(across.coordinate, across.coordinate, 1));
    return parameters->steepest_log * root(ray) * along.root;
}

/* -ln F */
static inline number regular_part(const number brightness, const number p, const number q, const number x,
                                  const number y, const parameter_set *parameters)
{
    return -logarithm(brightness);
}

/* -ln c */
static inline number norm_part(const number p, const number q, const number x, const number y,
                               const parameter_set *parameters)
{
    return minus_log_c(square_tangent(p, q, x, y), parameters);
}

static inline number coefficient_of_norm(const number brightness)
{
    return 1;
}

/* The p at which t, and so H, is least for fixed q: -x (1 + y q) / (1 + x^2); with `along_y` the q for fixed p. */
static inline number argmin_gradient(const number brightness, const number gradient_across, const number along,
                                    const number across, const int along_y, const parameter_set *parameters)
{
    return -along * multiply_add(across, gradient_across, 1) / multiply_add(along, along, 1);
}

/* P_c along one axis: the middle of {P : H(Z, P) <= 0} at any Z. */
static inline number middle_gradient(const number brightness, const number here, const number x, const number y,
                                     const int along_y, const parameter_set *parameters)
{
    const number inverse_ray = 1 / multiply_add(x, x, multiply_add(y, y, 1));
    return -(along_y ? y : x) * inverse_ray;
}

/* The outward normal of the ellipse through P, A (P - P_c). */
static inline slopes outward_normal(const number brightness, const number here, const number p, const number q,
                                    const number x, const number y, const parameter_set *parameters)
{
    const number radial = multiply_add(x, p, multiply_add(y, q, 1));
    const slopes normal = {multiply_add(x, radial, p), multiply_add(y, radial, q)};
    return normal;
}

/* The forward model: I = kappa c / r^2, from Z and its gradient. */
static inline number rendered(const number log_depth, const number p, const number q, const number x, const number y,
                              const parameter_set *parameters)
{
    const number ray = multiply_add(x, x, multiply_add(y, y, 1));
    return exponential(-2 * log_depth - norm_part(p, q, x, y, parameters)) / ray;
}
