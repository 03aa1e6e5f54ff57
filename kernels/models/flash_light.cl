/* A light at the optical centre that fades with the square of the distance: a flash, the lamp of an endoscope.
 *
 *     I = kappa c(theta) / r^2,    r = z R,    cos theta = 1 / (R S),    R^2 = 1 + x^2 + y^2
 *
 * In `brightness` stands F = I R^2 / kappa, so that F exp(2 Z) = c. The material gives dimming(t) = -ln c as a function of
 * t = tan theta, the steepness of the surface as the light sees it, and
 *
 *     H(Z, P) = 2 Z + ln F - ln c(theta(P))
 *
 * rises with Z: there is one solution, without values on the boundary. With P_c = -(x, y) / R^2 the gradients of one
 * steepness are an ellipse around P_c:
 *
 *     t^2 = R^2 (P - P_c)' A (P - P_c),    A = I + (x, y)(x, y)'
 */
#define PULL 2


/* R^2 t^2 from the gradient. The term of P - P_c along the ray is small where x and y are: nothing cancels. */
static inline number square_tangent(const number p, const number q, const number x, const number y)
{
    const number ray = multiply_add(x, x, multiply_add(y, y, (number)1));
    const number along_x = multiply_add(p, ray, x), along_y = multiply_add(q, ray, y);
    const number radial = multiply_add(x, along_x, y * along_y);
    return multiply_add(radial, radial, multiply_add(along_x, along_x, along_y * along_y)) / ray;
}

/* |dH/dp| <= sigma_x = max |d ln c / dt| R sqrt(1 + x^2): this is sigma_x / (2 dx), and with the axes in the other order
 * sigma_y / (2 dy).
 */
static inline number viscosity(const number brightness, const axis along, const axis across, const parameter_set *parameters)
{
    const number ray = multiply_add(along.coordinate, along.coordinate,
                                    multiply_add(across.coordinate, across.coordinate, (number)1));
    return parameters->steepest_log * root(ray) * along.root;
}

static inline number regular_part(const number brightness, const number p, const number q, const number x,
                                  const number y, const parameter_set *parameters)
{
    return -logarithm(brightness);
}

static inline number norm_part(const number p, const number q, const number x, const number y, const parameter_set *parameters)
{
    return dimming(square_tangent(p, q, x, y), parameters);
}

static inline number factor_of_norm(const number brightness)
{
    return (number)1;
}

/* The slope along one axis at which the surface is least steep for the light, for a fixed slope along the other. */
static inline number least_gradient(const number brightness, const number gradient_across, const number along,
                                    const number across, const int along_y, const parameter_set *parameters)
{
    return -along * multiply_add(across, gradient_across, (number)1) / multiply_add(along, along, (number)1);
}

/* P_c along one axis: the middle of the gradients of any steepness. */
static inline number middle_gradient(const number brightness, const number here, const number x, const number y,
                                     const int along_y, const parameter_set *parameters)
{
    const number inverse_ray = (number)1 / multiply_add(x, x, multiply_add(y, y, (number)1));
    return -(along_y ? y : x) * inverse_ray;
}

/* The normal of the ellipse through P, A (P - P_c). */
static inline slopes outward_normal(const number brightness, const number here, const number p, const number q,
                                    const number x, const number y, const parameter_set *parameters)
{
    const number radial = multiply_add(x, p, multiply_add(y, q, (number)1));
    const slopes normal = {multiply_add(x, radial, p), multiply_add(y, radial, q)};
    return normal;
}

/* The forward model. */
static inline number rendered(const number log_depth, const number p, const number q, const number x, const number y,
                              const parameter_set *parameters)
{
    const number ray = multiply_add(x, x, multiply_add(y, y, (number)1));
    return exponential(-(number)2 * log_depth - norm_part(p, q, x, y, parameters)) / ray;
}
