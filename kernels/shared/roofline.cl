/* What a device can do at best, to measure the sweeps against: copies without arithmetic, arithmetic without memory. */

typedef float4 block;

/* One work-item copies one block: global size (blocks,). */
__kernel void copy(__global const block *from, /* shape (blocks,) */
                   __global block *to)         /* same shape      */
{
    const size_t k = get_global_id(0);
    to[k] = from[k];
}

#define CHAINS 12

/* Chains of multiply-adds that do not wait for each other, enough of them to hide the latency. Unlike in the sweeps the
 * compiler may fuse them. One work-item does 2 * CHAINS * LANES * rounds floating-point operations: global size any.
 */
__kernel void multiply_adds(__global real *results, /* what keeps the chains from being left out, shape (items,) */
                            const int rounds,       /* length of a chain                                         */
                            const real factor,      /* below 1, so that the numbers stay finite                  */
                            const real summand)     /* above 0, so that they stay normal                         */
{
#pragma OPENCL FP_CONTRACT ON
    number chains[CHAINS];
    for (int k = 0; k < CHAINS; ++k)
        chains[k] = (number)(real)(k + 1);
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
