/* New values of cells by the upwind scheme, climb.cl, for lights under which H does not depend on Z:
 *
 *     Z = least climb from the left and the upper neighbour with gradients in {P : H(P) <= 0}
 *
 * For the lanes of one vector; it reads no memory.
 */
#define RIM_CELLS 0 /* a missing neighbour has the value NOWHERE: no cell is treated apart */
#define DIRECTED 1  /* a cell reads only the two neighbours before it in the sweep */

static inline number inner_value(const number brightness, const number here, const number left, const number right,
                                 const number up, const number down, const sided to_p, const sided to_q, const axis x,
                                 const axis y, const parameter_set *parameters)
{
    const light_frame at = light_frame_at(x.coordinate, y.coordinate, parameters);
    return least_climb(darkness(brightness), left, up, to_p, to_q, at, parameters->steepest);
}
