/* Candidate value of one cell by the Lax-Friedrichs scheme, eq. (11) with its sign put right:
 *
 *     Z = [ -H(p, q) + sigma_x (Z_r + Z_l) / (2 dx) + sigma_y (Z_d + Z_u) / (2 dy) ] / (sigma_x / dx + sigma_y / dy)
 *
 * with central differences p and q. Nondecreasing in every neighbour, since sigma bounds the derivatives of H: the
 * scheme is monotone.
 */
static inline real candidate(const real brightness, /* E                                */
                             const real gradient_x, /* p, of Z or W                     */
                             const real gradient_y, /* q                                */
                             const real sum_x,      /* Z_r + Z_l                        */
                             const real sum_y,      /* Z_d + Z_u                        */
                             const real x, const real y, __constant const real *parameters)
{
    const real energy = hamiltonian(brightness, gradient_x, gradient_y, x, y, parameters);
    const real weight_x = viscosity_x(brightness, x, parameters) * parameters[HALF_INVERSE_DX];
    const real weight_y = viscosity_y(brightness, y, parameters) * parameters[HALF_INVERSE_DY];
    const real numerator = multiply_add(weight_x, sum_x, multiply_add(weight_y, sum_y, -energy));
    return numerator / ((real)2 * (weight_x + weight_y));
}
