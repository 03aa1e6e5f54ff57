"""Which class, and of what sizes, stands on a device for an ordering that has several.

Strips and bands want few work-groups, each with one item and wide vectors: what a CPU is good at, if its compiler is
known to take them. Elsewhere the wavefront goes tile by tile, and the checkerboard a colour at a time, with many items.
"""

from __future__ import annotations

from persfs_cl._cl.orderings.checkerboard import Checkerboard
from persfs_cl._cl.orderings.checkerboard_bands import CheckerboardBands
from persfs_cl._cl.orderings.ordering import Ordering, Setup
from persfs_cl._cl.orderings.strips import Strips
from persfs_cl._cl.orderings.three_colours import ThreeColours
from persfs_cl._cl.orderings.wavefront_images import WavefrontImages
from persfs_cl._cl.orderings.wavefront_strips import WavefrontStrips
from persfs_cl._cl.orderings.wavefront_tiles import WavefrontTiles
from persfs_cl._cl.registers import SUFFICIENT, WIDEST, lanes
from persfs_cl.blocks import usable_cores

_BAND_PIXELS = 4096
"""The bands that a group works on at a time stay in a processor's second-level cache, eight half-sweeps long."""
_CACHED_PIXELS = 2**20
"""An image of this size, with its brightness, stays in a processor's second-level cache, or nearly."""
_SMALL_PIXELS = 2**16
"""Up to this size a second processor saves less than working together costs."""


def wavefront(setup: Setup) -> Ordering:
    """Strips, whole images or tiles."""
    wide = lanes_of_strips(setup)
    groups, pixels = _resources(setup)
    if wide == 1:
        return WavefrontTiles.of(setup)
    kind: type[Strips] = WavefrontStrips
    if pixels <= _SMALL_PIXELS or (setup.images >= groups and pixels <= _CACHED_PIXELS):
        kind, groups = WavefrontImages, min(setup.images, groups)
    order = {"second_order": setup.second_order, "only_lower": setup.only_lower}
    return kind(wide, work_groups=groups, **order)


def checkerboard(setup: Setup) -> Ordering:
    """Bands or single colours; at second order a third colour."""
    if setup.second_order:
        return ThreeColours.of(setup)
    wide = lanes(setup.device, setup.precision)
    groups, pixels = _resources(setup)
    if wide == 1:
        return Checkerboard.of(setup)
    if pixels <= _SMALL_PIXELS:
        groups = min(setup.images, groups)
    rows = -(-_BAND_PIXELS // setup.shape[1])
    return CheckerboardBands(wide, band_rows=rows, work_groups=groups, only_lower=setup.only_lower)


def lanes_of_strips(setup: Setup) -> int:
    """Cells of a vector of strips and whole images."""
    # From one vector to the next Lax-Friedrichs waits for a root and a quotient. What settles, the upwind scheme, has
    # so much else to compute that this wait does not matter.
    return lanes(setup.device, setup.precision, WIDEST if setup.settles else SUFFICIENT)


def _resources(setup: Setup) -> tuple[int, int]:
    """Work-groups that have a processor each, and pixels of an image."""
    # A group that waits keeps its processor: more groups than processors would only be in each other's way.
    return min(setup.device.compute_units, usable_cores()), setup.shape[0] * setup.shape[1]
