/* Any material under a parallel light s = (-p0, -q0, 1), for the Lax-Friedrichs scheme, which takes any Hamiltonian:
 *
 *     H(P) = E - c(P),    c by lit = n / (k S),  seen = 1 / (R S)  and  between = f / (k R)
 *
 * the cosines between normal and light, normal and ray, and light and ray; w, S, n, k and `sign` are as in
 * parallel_light.cl, f = 1 + p0 x + q0 y, R^2 = 1 + x^2 + y^2. S H, the form of parallel_light.cl, has the same
 * solutions and smears them more: it is steepest at grazing, where no surfaces are, and H where they are. `brightness`
 * is E.
 *
 * c depends on the unit normal alone, whose derivative by p has at most the length sqrt(1 + x^2) / S. So
 *
 *     |dH/dp| <= sigma_x = steepness R sqrt(1 + x^2)
 *
 * with the largest product of `seen` and the slope of c across the ray, over all normals, as the steepness, found on
 * the host.
 *
 * For the lanes of one vector; it reads no memory.
 */
#define DH_DZ 0

/* R */
static inline number ray_length(const number x, const number y)
{
    return root(multiply_add(x, x, multiply_add(y, y, 1)));
}

/* sigma_x / (2 dx), and with the axes in the other order sigma_y / (2 dy). */
static inline number viscosity(const number brightness, const axis along, const axis across,
                               const parameter_set *parameters)
{
    return parameters->steepness * ray_length(along.coordinate, across.coordinate) * along.root;
}

/* M = c(P) */
static inline number regular_part(const number brightness, const number p, const number q, const number x,
                                  const number y, const parameter_set *parameters)
{
    const number light_x = parameters->p0, light_y = parameters->q0;
    const number w = multiply_add(x, p, multiply_add(y, q, 1));
    const number inverse_norm = 1 / root(multiply_add(w, w, multiply_add(p, p, q * q)));
    const number inverse_ray = 1 / ray_length(x, y);
    const number n = multiply_add(x - light_x, p, multiply_add(y - light_y, q, 1));
    const number lit = n * inverse_norm * parameters->inverse_norm;
    const number between = multiply_add(x, light_x, multiply_add(y, light_y, 1)) * inverse_ray;
    return returned_light(lit, inverse_ray * inverse_norm, between * parameters->inverse_norm, parameters);
}

/* N = 1, with which C N = E. */
static inline number norm_part(const number p, const number q, const number x, const number y,
                               const parameter_set *parameters)
{
    return 1;
}

static inline number coefficient_of_norm(const number brightness)
{
    return brightness;
}

/* The slope along one axis, of Z or W, at which a Lambertian surface is brightest for a fixed slope along the other:
 * argmin of its H, an estimate for other materials. How far it is right decides how far the scheme is a state
 * constraint where a neighbour is missing.
 *
 * The normals with that slope across span a plane with (0, q, -v) and (1, 0, -x), v = 1 + y q, on which the direction
 * of the light is projected. Where that leads beyond grazing it is the steepest slope.
 */
static inline number argmin_gradient(const number brightness, const number gradient_across, const number along,
                                    const number across, const int along_y, const parameter_set *parameters)
{
    const real light_along = along_y ? parameters->q0 : parameters->p0;
    const real light_across = along_y ? parameters->p0 : parameters->q0;
    const number steepest = parameters->steepest;
    const number q = parameters->sign * gradient_across;
    const number v = multiply_add(across, q, 1);
    const number square = multiply_add(q, q, v * v), mixed = along * v, other = multiply_add(along, along, 1);
    const number toward = fnma(q, light_across, v), tilt = along - light_along;
    const number rise = fnma(mixed, toward, square * tilt);
    const number base = fnma(mixed, tilt, other * toward);
    const number slope = base > 0 ? rise / base : (tilt < 0 ? -steepest : steepest);
    return parameters->sign * most(least(slope, steepest), -steepest);
}

/* The forward model: E = c(P). */
static inline number rendered(const number log_depth, const number p, const number q, const number x, const number y,
                              const parameter_set *parameters)
{
    return regular_part(0, p, q, x, y, parameters);
}
