/* The limits of a device that the sweeps are measured against, as in a roofline model: copies without arithmetic, and
 * arithmetic without memory traffic.
 */

typedef float4 block;

/* to = from. One work-item copies one block: global size (blocks,). */
__kernel void copy(__global const block *from, /* shape (blocks,) */
                   __global block *to)         /* same shape      */
{
    const size_t k = get_global_id(0);
    to[k] = from[k];
}

#define CHAINS 12

/* CHAINS independent recurrences a <- a factor + summand, enough of them to hide the latency. Unlike in the sweeps the
 * compiler may fuse the operations. One work-item does 2 * CHAINS * LANES * rounds floating-point operations and writes
 * one number: global size any.
 */
__kernel void multiply_adds(__global real *results, /* what keeps the chains from being left out, shape (items,) */
                            const int rounds,       /* length of a chain                                         */
                            const real factor,      /* below 1, so that the numbers stay finite                  */
                            const real summand)     /* above 0, so that they stay normal                         */
{
#pragma OPENCL FP_CONTRACT ON
    number chains[CHAINS];
    for (int k = 0; k < CHAINS; ++k)
        chains[k] = k + 1;
    for (int round = 0; round < rounds; ++round)
        __attribute__((opencl_unroll_hint(CHAINS))) for (int k = 0; k < CHAINS; ++k)
            chains[k] = chains[k] * factor + summand;
    number sum = chains[0];
    for (int k = 1; k < CHAINS; ++k)
        sum += chains[k];
    union {
        number all;
        real lane[LANES];
    } each;
    each.all = sum;
    real total = 0;
    for (int k = 0; k < LANES; ++k)
        total += each.lane[k];
    results[get_global_id(0)] = total;
}
