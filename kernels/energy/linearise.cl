/* The energy of a surface, and what Gauss-Newton's method with reweighting makes of each of its terms:
 *
 *     sum W rho(r; C)  +  MU sum rho((Z - G) / tolerance; C')  +  LAMBDA sum |second differences of Z| (Charbonnier)
 *
 * rho(r; C) = C^2 / 2 ln(1 + (r / C)^2) is Cauchy's function, with the weight 1 / (1 + (r / C)^2); Charbonnier's is
 * C^2 (sqrt(1 + (d / C)^2) - 1), with the weight 1 / sqrt(1 + (d / C)^2). The residual of a pixel is
 *
 *     PAINTED 0:   r = (E - B) / sigma,                        sigma^2 = noise^2 + (share E)^2
 *     PAINTED 1:   r = (ln(E + dark) - ln B - white) b / spread,    b = E / (E + 3 dark)
 *
 * with B = (R + sqrt(R^2 + 4 floor^2)) / 2, the brightness R of the surface, which stays above 0 in shadow. Slopes are
 * central differences, one-sided where a neighbour is missing, and 0 where both are.
 *
 * One work-item does one pixel; global size (width rounded up to GROUP, height). It reads Z there and around, and writes
 * the derivatives of its residual by Z of the pixel and of its neighbours left, right, above and below, and the residual,
 * both times the square root of the weight; the weights of the second differences along x, along y and across, that of
 * the square whose first corner it is; and the prior's part of the matrix and of the gradient. Of each group it writes
 * the energy, and two sums from which the best `white` follows.
 */
static inline real cauchy(const real square, const real scale)
{
    return 0.5f * scale * scale * logarithm(1 + square);
}

/* From the ratio of a difference to the scale: Charbonnier's function, divided by the square of the scale. The plain
 * form would lose small differences.
 */
static inline real charbonnier(const real square)
{
    return square / (root(1 + square) + 1);
}

__kernel void linearise(__global const real *log_depth,  /* Z less a level, padded                              */
                        __global const real *brightness, /* E, padded                                           */
                        __global const uchar *flags,     /* see prelude, padded; SWEPT where E counts           */
                        __global const real *prior,      /* G less the level, padded                            */
                        __global const real *certainty,  /* 1 / tolerance, 0 where there is no prior, padded    */
                        __global const parameter_set *parameters, /* of light and material                      */
                        __global const real *columns,    /* x, shape (width,)                                   */
                        __global const real *lines,      /* y, shape (height,)                                  */
                        __global real *derivatives,      /* five planes, padded                                 */
                        __global real *residuals,        /* padded                                              */
                        __global real *curvature_weights, /* three planes, padded                               */
                        __global real *prior_terms,      /* two planes, padded                                  */
                        __global real *partial,          /* three sums of each group                            */
                        const real noise,                /* of brightness, or the spread of ln albedo           */
                        const real share,                /* of E by which the model may err                     */
                        const real floor_brightness,     /* floor                                               */
                        const real dark,                 /* brightness that hardly counts                       */
                        const real white,                /* level of ln albedo                                  */
                        const real weight,               /* W                                                   */
                        const real scale,                /* C                                                   */
                        const real prior_weight,         /* MU                                                  */
                        const real prior_scale,          /* C'                                                  */
                        const real smoothness,           /* LAMBDA                                              */
                        const real inverse_crease,       /* 1 / scale of second differences                     */
                        const real bend_x,               /* from the second difference of Z to that of slopes   */
                        const real bend_y,               /* likewise                                            */
                        const int width,                 /* pixels                                              */
                        const int height,                /* pixels                                              */
                        const int stride)                /* of padded rows                                      */
{
    __local real shared[GROUP];
    const int column = (int)get_global_id(0), row = (int)get_global_id(1);
    real energy = 0, white_sum = 0, white_weight = 0;
    if (column < width) {
        const size_t cell = cell_at(column, row, stride), plane = (size_t)stride * (size_t)(height + 2 * PAD);
        const int flag = flags[cell];
        const real here = log_depth[cell];
        const real left = log_depth[cell - 1], right = log_depth[cell + 1];
        const real up = log_depth[cell - (size_t)stride], down = log_depth[cell + (size_t)stride];

        const real from_left = flag & NO_LEFT ? (real)0 : (flag & NO_RIGHT ? (real)-1 : (real)-0.5f);
        const real from_right = flag & NO_RIGHT ? (real)0 : (flag & NO_LEFT ? (real)1 : (real)0.5f);
        const real from_up = flag & NO_UP ? (real)0 : (flag & NO_DOWN ? (real)-1 : (real)-0.5f);
        const real from_down = flag & NO_DOWN ? (real)0 : (flag & NO_UP ? (real)1 : (real)0.5f);
        const parameter_set numbers = parameters[0];
        const real per_dx = 2 * numbers.half_inverse_dx, per_dy = 2 * numbers.half_inverse_dy;
        /* Differences first: of large numbers nothing small must be left over. */
        const real p = per_dx * (from_right * (right - here) - from_left * (here - left));
        const real q = per_dy * (from_down * (down - here) - from_up * (here - up));
        real slopes[3];
        const real shaded = shade(here, p, q, columns[column], lines[row], &numbers, slopes);
        const real span = root(multiply_add(shaded, shaded, 4 * floor_brightness * floor_brightness));
        const real least_shade = floor_brightness * floor_brightness;
        /* Of two forms that in which nothing cancels. */
        const real lifted = shaded > 0 ? 0.5f * (shaded + span) : 2 * least_shade / (span - shaded);
        const int counts = flag & SWEPT;
        const real given = counts ? brightness[cell] : (real)1;
#if PAINTED
        const real lit_share = given / (given + 3 * dark), per_spread = lit_share / noise;
        const real apart = logarithm((given + dark) / lifted);
        const real residual = (apart - white) * per_spread;
        const real by_shade = -per_spread / span;
#else
        const real per_sigma = 1 / root(multiply_add(noise, noise, share * share * given * given));
        const real residual = (given - lifted) * per_sigma;
        const real by_shade = -per_sigma * lifted / span;
#endif
        const real ratio = residual / scale, square = ratio * ratio;
        const real robust = counts ? weight / (1 + square) : (real)0;
        const real half_weight = root(robust), factor = half_weight * by_shade;
        const real along_x = factor * slopes[1] * per_dx, along_y = factor * slopes[2] * per_dy;
        derivatives[cell] = factor * slopes[0] - along_x * (from_left + from_right) - along_y * (from_up + from_down);
        derivatives[plane + cell] = along_x * from_left;
        derivatives[2 * plane + cell] = along_x * from_right;
        derivatives[3 * plane + cell] = along_y * from_up;
        derivatives[4 * plane + cell] = along_y * from_down;
        residuals[cell] = half_weight * residual;
        energy = counts ? weight * cauchy(square, scale) : (real)0;
#if PAINTED
        white_weight = robust * per_spread * per_spread;
        white_sum = white_weight * apart;
#endif

        const real sure = certainty[cell], off = (here - prior[cell]) * sure;
        const real off_ratio = off / prior_scale, off_square = off_ratio * off_ratio;
        const real pull = prior_weight * sure / (1 + off_square);
        prior_terms[cell] = pull * sure;
        prior_terms[plane + cell] = pull * off;
        energy += sure > 0 ? prior_weight * cauchy(off_square, prior_scale) : (real)0;

        const int in_row = !(flag & (NO_LEFT | NO_RIGHT)), in_column = !(flag & (NO_UP | NO_DOWN));
        const int in_square = !(flag & (NO_RIGHT | NO_DOWN)) && !(flags[cell + (size_t)stride] & NO_RIGHT);
        const real opposite = log_depth[cell + (size_t)stride + 1];
        const real bend = root(bend_x * bend_y);
        const real bent[3] = {
            in_row ? bend_x * ((right - here) - (here - left)) : (real)0,
            in_column ? bend_y * ((down - here) - (here - up)) : (real)0,
            in_square ? bend * ((opposite - down) - (right - here)) : (real)0,
        };
        /* The mixed derivative counts twice, as in the norm of a matrix. */
        const real strength[3] = {smoothness * bend_x * bend_x, smoothness * bend_y * bend_y,
                                  2 * smoothness * bend_x * bend_y};
        const int there[3] = {in_row, in_column, in_square};
        const real share_of[3] = {smoothness, smoothness, 2 * smoothness};
        for (int kind = 0; kind < 3; ++kind) {
            const real bend_ratio = bent[kind] * inverse_crease, bend_square = bend_ratio * bend_ratio;
            curvature_weights[kind * plane + cell] = there[kind] ? strength[kind] / root(1 + bend_square) : (real)0;
            energy += share_of[kind] * charbonnier(bend_square) / (inverse_crease * inverse_crease);
        }
    }
    const real sums[3] = {
        sum_of_group(energy, shared),
        sum_of_group(white_sum, shared),
        sum_of_group(white_weight, shared),
    };
    if (get_local_id(0) == 0) {
        const size_t group = get_global_id(1) * get_num_groups(0) + get_group_id(0);
        for (int kind = 0; kind < 3; ++kind)
            partial[3 * group + (size_t)kind] = sums[kind];
    }
}
