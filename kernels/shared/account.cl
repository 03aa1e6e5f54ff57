/* An account of changes: for each part of an image the number of the last sweep that changed it, so that parts can rest
 * of which neither they nor what they read have changed since a sweep last ran them.
 *
 * `changed` has the parts of an image row by row, with some more on every side, to be read without a question. Where
 * tiles are the parts, see tiles.cl.
 */

/* The last sweep that changed a part or one of the four beside it, in rows of `across` parts. */
static inline int last_change_around(__global volatile int *part, const int across)
{
    return max(part[0], max(max(part[-1], part[1]), max(part[-across], part[across])));
}

/* The place of a part in the account of the colour that has its turn in a half-sweep: of an image with `parts` of both
 * colours together, those of one come before those of the other.
 */
static inline int part_of_colour(const int part, const int parts, const int turn)
{
    return (turn & 1) * parts + part;
}

/* Whether a half-sweep might change its colour in a part: if its last one did, or that of the other colour changed what
 * this one reads. The account of that colour is at rest by now, whatever others are doing.
 */
static inline int colour_may_change(__global volatile int *changed, const int part, const int parts, const int across,
                                    const int turn)
{
    return changed[part_of_colour(part, parts, turn)] >= turn - 2 ||
           last_change_around(changed + part_of_colour(part, parts, turn + 1), across) >= turn - 1;
}
