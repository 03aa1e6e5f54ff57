/* New values of cells by the upwind scheme, climb.cl, for lights under which the gradients that a brightness allows do not
 * depend on Z.
 */
#define RIM_CELLS 0
#define DIRECTED 1 /* a cell looks only at the two neighbours before it in the sweep */

static inline number inner_value(const number brightness, const number here, const number left, const number right,
                                 const number up, const number down, const sided to_p, const sided to_q, const axis x,
                                 const axis y, const parameter_set *parameters)
{
    return least_climb(darkness(brightness), left, up, to_p, to_q, sight_at(x.coordinate, y.coordinate, parameters),
                       (number)parameters->steepest);
}
