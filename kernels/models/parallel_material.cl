/* Any material under a parallel light s = (-p0, -q0, 1), for the Lax-Friedrichs scheme, which takes any Hamiltonian:
 *
 *     H(P) = E - R(P)
 *
 * with R the brightness of a surface by the cosines between its normal and the light, lit = n / (k S), between its normal
 * and the ray, seen = 1 / (R S), and between light and ray. It has the same solutions as S times that, the form of
 * parallel_light.cl, and smears them less: E - R(P) has its steepest slope where surfaces are, S (E - R(P)) at grazing.
 * `sign` is as there.
 *
 * All depends on the normal N alone, and |dN/dp| <= sqrt(1 + x^2) / S. So
 *
 *     |dH/dp| <= sigma_x = steepness R sqrt(1 + x^2)
 *
 * with the largest of seen |dR/dN| across the ray over all N as the steepness, found on the host.
 */
#define PULL 0


static inline number ray_length(const number x, const number y)
{
    return root(multiply_add(x, x, multiply_add(y, y, (number)1)));
}

/* sigma_x / (2 dx), and with the axes in the other order that of y. */
static inline number viscosity(const number brightness, const axis along, const axis across, const parameter_set *parameters)
{
    return parameters->steepness * ray_length(along.coordinate, across.coordinate) * along.root;
}

/* R(P) */
static inline number regular_part(const number brightness, const number p, const number q, const number x,
                                  const number y, const parameter_set *parameters)
{
    const number light_x = (number)parameters->p0, light_y = (number)parameters->q0;
    const number w = multiply_add(x, p, multiply_add(y, q, (number)1));
    const number inverse_norm = (number)1 / root(multiply_add(w, w, multiply_add(p, p, q * q)));
    const number inverse_ray = (number)1 / ray_length(x, y);
    const number n = multiply_add(x - light_x, p, multiply_add(y - light_y, q, (number)1));
    const number lit = n * inverse_norm * parameters->inverse_norm;
    const number between = multiply_add(x, light_x, multiply_add(y, light_y, (number)1)) * inverse_ray;
    return returned_light(lit, inverse_ray * inverse_norm, between * parameters->inverse_norm,
                          parameters);
}

static inline number norm_part(const number p, const number q, const number x, const number y, const parameter_set *parameters)
{
    return (number)1;
}

static inline number factor_of_norm(const number brightness)
{
    return brightness;
}

/* The slope along one axis, of Z or W, at which a Lambertian surface is brightest, for a fixed slope along the other: a
 * guess for other materials. Beside a missing neighbour the scheme is a state constraint as far as it is right.
 *
 * The normals with that slope across are a plane, of (0, q, -v) and (1, 0, -x) with v = 1 + y q; the light's direction is
 * projected on it. Where that leads beyond grazing it is the steepest slope.
 */
static inline number least_gradient(const number brightness, const number gradient_across, const number along,
                                    const number across, const int along_y, const parameter_set *parameters)
{
    const real light_along = along_y ? parameters->q0 : parameters->p0;
    const real light_across = along_y ? parameters->p0 : parameters->q0;
    const number steepest = (number)parameters->steepest;
    const number q = parameters->sign * gradient_across;
    const number v = multiply_add(across, q, (number)1);
    const number square = multiply_add(q, q, v * v), mixed = along * v, other = multiply_add(along, along, (number)1);
    const number toward = multiply_subtract_from(v, q, (number)light_across), tilt = along - light_along;
    const number rise = multiply_subtract_from(square * tilt, mixed, toward);
    const number base = multiply_subtract_from(other * toward, mixed, tilt);
    const number slope = base > (number)0 ? rise / base : (tilt < (number)0 ? -steepest : steepest);
    return parameters->sign * most(least(slope, steepest), -steepest);
}

/* The forward model. */
static inline number rendered(const number log_depth, const number p, const number q, const number x, const number y,
                              const parameter_set *parameters)
{
    return regular_part((number)0, p, q, x, y, parameters);
}
