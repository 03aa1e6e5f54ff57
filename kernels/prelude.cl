/* What every program begins with: the real type, multiply-add, and the meaning of a cell's flags.
 *
 * Built with -D USE_DOUBLE=0 or 1. Contraction is off and every fused multiply-add is written out, so that two
 * orderings compiled from the same cell update give the same bits on a device.
 */
#if USE_DOUBLE
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
typedef double real;
#else
typedef float real;
#endif

#pragma OPENCL FP_CONTRACT OFF

#define multiply_add(a, b, c) fma((a), (b), (c))

/* Flags of a cell. A neighbour is missing where the image or the mask ends, or where a wall stands. */
#define SWEPT 1u
#define NO_LEFT 2u
#define NO_RIGHT 4u
#define NO_UP 8u
#define NO_DOWN 16u
#define MISSING (NO_LEFT | NO_RIGHT | NO_UP | NO_DOWN)

/* Indices into the parameters that every model shares; a model's own begin at FIRST_MODEL_PARAMETER. */
#define GRID_X0 0     /* x of column 0                                     */
#define GRID_DX 1     /* pixel spacing in x, 1/fx                          */
#define GRID_Y0 2     /* y of row 0                                        */
#define GRID_DY 3     /* pixel spacing in y, 1/fy                          */
#define HALF_INVERSE_DX 4 /* 1 / (2 dx)                                    */
#define HALF_INVERSE_DY 5 /* 1 / (2 dy)                                    */
#define STEP_X 6      /* largest climb of Z between horizontal neighbours  */
#define STEP_Y 7      /* largest climb of Z between vertical neighbours    */
#define FIRST_MODEL_PARAMETER 8
