/* The energy of a surface, and what Gauss-Newton's method with reweighting makes of each of its terms:
 *
 *     sum W rho(r; C)  +  MU sum phi((Z - G) / tolerance; C')  +  LAMBDA sum phi(second differences of Z; C'')
 *
 * rho(r; C) = C^2 / 2 ln(1 + (r / C)^2) is Cauchy's function, with the weight 1 / (1 + (r / C)^2), and
 * phi(d; C) = C^2 (sqrt(1 + (d / C)^2) - 1) Charbonnier's, with the weight 1 / sqrt(1 + (d / C)^2). The former lets go of
 * pixels that are far off, as highlights are, the latter pulls at them no less. The residual of a pixel is
 *
 *     PAINTED 0:   r = (E - B) / sigma,                        sigma^2 = noise^2 + (share E)^2
 *     PAINTED 1:   r = (ln(E + dark) - ln B - white) b / spread,    b = E / (E + 3 dark)
 *
 * with B = (R + sqrt(R^2 + 4 floor^2)) / 2, the brightness R of the surface, which stays above 0 in shadow. Slopes are
 * central differences, one-sided where a neighbour is missing, and 0 where both are.
 *
 * Global size (work-items of a row, height). Of each pixel Z is read there and around, and written are the derivatives of
 * its residual by Z of the pixel and of its neighbours left, right, above and below, and the residual, both times the
 * square root of the weight; the weights of the second differences along x, along y and across, that of the square whose
 * first corner it is; and the prior's part of the matrix and of the gradient. Each work-item writes its part of the
 * energy, and of two sums from which the best `white` follows.
 */
static inline number cauchy(const number square, const real scale)
{
    return 0.5f * scale * scale * logarithm(1 + square);
}

/* From the square of the ratio of a difference to the scale: Charbonnier's function, divided by the square of the scale.
 * The plain form would lose small differences.
 */
static inline number charbonnier(const number square)
{
    return square / (root(1 + square) + 1);
}

__kernel void linearise(__global const real *log_depth,  /* Z less a level, padded                              */
                        __global const real *brightness, /* E, padded                                           */
                        __global const uchar *flags,     /* see prelude, padded; SWEPT where E counts           */
                        __global const real *prior,      /* G less the level, padded                            */
                        __global const real *certainty,  /* 1 / tolerance, 0 where there is no prior, padded    */
                        __global const parameter_set *parameters, /* of light and material                      */
                        __global const real *columns,    /* x, for as many pixels as rows are apart             */
                        __global const real *lines,      /* y, shape (height,)                                  */
                        __global real *derivatives,      /* five planes, padded                                 */
                        __global real *residuals,        /* padded                                              */
                        __global real *curvature_weights, /* three planes, padded                               */
                        __global real *prior_terms,      /* two planes, padded                                  */
                        __global real *partial,          /* three sums of each work-item                        */
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
                        const real inverse_crease,       /* 1 / C''                                             */
                        const real bend_x,               /* from the second difference of Z to that of slopes   */
                        const real bend_y,               /* likewise                                            */
                        const int width,                 /* pixels                                              */
                        const int height,                /* pixels                                              */
                        const int stride)                /* of padded rows                                      */
{
    const int row = (int)get_global_id(1);
    const size_t line = (size_t)stride, plane = line * (size_t)(height + 2 * PAD);
    const parameter_set numbers = parameters[0];
    const real per_dx = 2 * numbers.half_inverse_dx, per_dy = 2 * numbers.half_inverse_dy;
    const real bend = ROOT(bend_x * bend_y);
    /* The mixed derivative counts twice, as in the norm of a matrix. */
    const real share_of[3] = {smoothness, smoothness, 2 * smoothness};
    const real strength[3] = {smoothness * bend_x * bend_x, smoothness * bend_y * bend_y,
                              2 * smoothness * bend_x * bend_y};
    number energy = 0, white_sum = 0, white_weight = 0;
    FOR_EACH_OF_ROW(column)
    {
        const size_t cell = cell_at(column, row, stride);
        const integer flag = GATHER(integer, flags + cell, 1), flag_below = GATHER(integer, flags + cell + line, 1);
        const number here = LOAD(log_depth + cell);
        const number left = LOAD(log_depth + cell - 1), right = LOAD(log_depth + cell + 1);
        const number up = LOAD(log_depth + cell - line), down = LOAD(log_depth + cell + line);
        const number opposite = LOAD(log_depth + cell + line + 1);

        const integer has_left = (flag & NO_LEFT) == 0, has_right = (flag & NO_RIGHT) == 0;
        const integer has_up = (flag & NO_UP) == 0, has_down = (flag & NO_DOWN) == 0;
        const number from_left = choose(has_left, choose(has_right, -0.5f, -1), 0);
        const number from_right = choose(has_right, choose(has_left, 0.5f, 1), 0);
        const number from_up = choose(has_up, choose(has_down, -0.5f, -1), 0);
        const number from_down = choose(has_down, choose(has_up, 0.5f, 1), 0);
        /* Differences first: of large numbers nothing small must be left over. */
        const number p = per_dx * (from_right * (right - here) - from_left * (here - left));
        const number q = per_dy * (from_down * (down - here) - from_up * (here - up));
        number slopes[3];
        const number x = LOAD(columns + column), y = lines[row];
        const number shaded = shade(here, p, q, x, y, &numbers, slopes);
        const number square_floor = floor_brightness * floor_brightness;
        const number span = root(multiply_add(shaded, shaded, 4 * square_floor));
        /* Of two forms that in which nothing cancels. */
        const number lifted = choose(shaded > 0, 0.5f * (shaded + span), 2 * square_floor / (span - shaded));
        const integer counts = (flag & SWEPT) != 0;
        const number given = choose(counts, LOAD(brightness + cell), 1);
#if PAINTED
        const number per_spread = given / (given + 3 * dark) / noise;
        const number apart = logarithm((given + dark) / lifted);
        const number residual = (apart - white) * per_spread;
        const number by_shade = -per_spread / span;
#else
        const number per_sigma = 1 / root(multiply_add(share * given, share * given, noise * noise));
        const number residual = (given - lifted) * per_sigma;
        const number by_shade = -per_sigma * lifted / span;
#endif
        const number ratio = residual / scale, square = ratio * ratio;
        const number robust = choose(counts, weight / (1 + square), 0);
        const number half_weight = root(robust), factor = half_weight * by_shade;
        const number along_x = factor * slopes[1] * per_dx, along_y = factor * slopes[2] * per_dy;
        STORE(derivatives + cell,
              factor * slopes[0] - along_x * (from_left + from_right) - along_y * (from_up + from_down));
        STORE(derivatives + plane + cell, along_x * from_left);
        STORE(derivatives + 2 * plane + cell, along_x * from_right);
        STORE(derivatives + 3 * plane + cell, along_y * from_up);
        STORE(derivatives + 4 * plane + cell, along_y * from_down);
        STORE(residuals + cell, half_weight * residual);
        energy += choose(counts, weight * cauchy(square, scale), 0);
#if PAINTED
        white_weight += robust * per_spread * per_spread;
        white_sum += robust * per_spread * per_spread * apart;
#endif

        const number sure = LOAD(certainty + cell), off = (here - LOAD(prior + cell)) * sure;
        const number off_ratio = off / prior_scale, off_square = off_ratio * off_ratio;
        const number pull = prior_weight * sure / root(1 + off_square);
        STORE(prior_terms + cell, pull * sure);
        STORE(prior_terms + plane + cell, pull * off);
        energy += choose(sure > 0, prior_weight * prior_scale * prior_scale * charbonnier(off_square), 0);

        const integer there[3] = {
            has_left & has_right,
            has_up & has_down,
            has_right & has_down & ((flag_below & NO_RIGHT) == 0),
        };
        const number bent[3] = {
            bend_x * ((right - here) - (here - left)),
            bend_y * ((down - here) - (here - up)),
            bend * ((opposite - down) - (right - here)),
        };
        for (int kind = 0; kind < 3; ++kind) {
            const number bend_ratio = bent[kind] * inverse_crease, bend_square = bend_ratio * bend_ratio;
            STORE(curvature_weights + kind * plane + cell,
                  choose(there[kind], strength[kind] / root(1 + bend_square), 0));
            energy += choose(there[kind], share_of[kind] * charbonnier(bend_square), 0) /
                      (inverse_crease * inverse_crease);
        }
    }
    __global real *sums = partial + 3 * place_of_item();
    sums[0] = sum_of_lanes(energy);
    sums[1] = sum_of_lanes(white_sum);
    sums[2] = sum_of_lanes(white_weight);
}
