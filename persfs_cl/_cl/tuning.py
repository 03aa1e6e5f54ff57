"""How the sweeps are laid out on a device: which kernels, and how much each work-group does."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

from persfs_cl._cl.device import Device
from persfs_cl._cl.layout import Layout
from persfs_cl._cl.registers import lanes

LANES = (1, 2, 4, 8)
"""Cells that a work-item may update at once: see kernels/shared/prelude.cl."""
_STRIP_VECTORS = 3
"""Vectors of a strip of the wavefront: the latency of the square root is hidden, and the registers suffice."""
_BAND_PIXELS = 4096
"""The bands that a group works on at a time stay in a processor's second-level cache, eight half-sweeps long."""
_CACHED_PIXELS = 2**20
"""An image of this size, with its brightness, stays in a processor's second-level cache, or nearly."""
_SMALL_PIXELS = 2**16
"""Up to this size a second processor saves less than working together costs."""


@dataclass(frozen=True)
class Tuning:
    """How the sweeps are laid out on a device; the results do not depend on it, but for the last two.

    Attributes
    ----------
    variant : str
        Kernel file of the sweep.
    lanes : int
        Cells a work-item updates at once.
    strip_rows : int
        Rows of a strip of the wavefront, whole vectors high.
    work_groups : int
        How many run along strips, or over images or bands, at a time.
    polls : int
        How long a work-group waits for another in vain: so many looks at its counter, of which bands, whose counters
        lie closer by, take a multiple. Some hundred microseconds.
    band_rows : int
        Rows of a band of the checkerboard.
    tile : tuple of int
        Rows and columns of a tile of the wavefront; as many work-items as rows make a work-group.
    second_order : bool
        Correct the differences of the upwind scheme to second order.
    only_lower : bool
        Let the corrected values only fall.
    """

    variant: str
    lanes: int = 1
    strip_rows: int = 1
    work_groups: int = 1
    polls: int = 4000
    band_rows: int = 1
    tile: tuple[int, int] = (32, 64)
    second_order: bool = False
    only_lower: bool = False

    @classmethod
    def of(
        cls,
        device: Device,
        ordering: str,
        precision: str,
        shape: tuple[int, int],
        images: int,
        *,
        second_order: bool = False,
        only_lower: bool = False,
    ) -> Tuning:
        """What suits a device, and a number of images of one size.

        Strips and bands want few work-groups, each with one item and wide vectors: what a CPU is good at, if its
        compiler is known to take them. Elsewhere the wavefront goes tile by tile, and the checkerboard a colour at a
        time, with many items.
        """
        tuning = cls._of_first_order(device, ordering, precision, shape, images)
        if not second_order:
            return tuning
        if ordering == "checkerboard":
            # Two colours do not suffice where a cell reads two neighbours on every side.
            tuning = cls("three_colours")
        return replace(tuning, second_order=True, only_lower=only_lower)

    @classmethod
    def _of_first_order(
        cls, device: Device, ordering: str, precision: str, shape: tuple[int, int], images: int
    ) -> Tuning:
        if ordering == "lexicographic":
            return cls("lexicographic")
        wide = lanes(device, precision)
        if wide == 1:
            return cls({"wavefront": "wavefront_tiles"}.get(ordering, ordering))
        pixels = shape[0] * shape[1]
        # A group that waits keeps its processor: more groups than processors would only be in each other's way.
        groups = min(device.compute_units, _processors())
        if ordering == "checkerboard":
            if pixels <= _SMALL_PIXELS:
                groups = min(images, groups)
            return cls("checkerboard_bands", wide, band_rows=-(-_BAND_PIXELS // shape[1]), work_groups=groups)
        rows = _STRIP_VECTORS * wide
        if pixels <= _SMALL_PIXELS or (images >= groups and pixels <= _CACHED_PIXELS):
            return cls("wavefront_images", wide, rows, work_groups=min(images, groups))
        return cls("wavefront_strips", wide, rows, work_groups=groups)

    @property
    def definitions(self) -> dict[str, int]:
        """Constants of the program."""
        sizes = {"REACH": 2, "ONLY_LOWER": int(self.only_lower)} if self.second_order else {}
        if self.in_strips:
            sizes |= {"VECTORS": self.strip_rows // self.lanes, "POLLS": self.polls}
        elif self.variant == "checkerboard_bands":
            sizes["POLLS"] = self.polls
        elif self.variant == "wavefront_tiles":
            sizes |= {"TILE_ROWS": self.tile[0], "TILE_COLUMNS": self.tile[1]}
        return {"LANES": self.lanes, **sizes}

    @property
    def kernels(self) -> tuple[str, ...]:
        """Kernel files after those of model and scheme."""
        order = "second_order" if self.second_order else "first_order"
        before = {
            "wavefront_images": (order, "update", "strip", "boundary", "change"),
            "wavefront_strips": (order, "update", "strip"),
            "checkerboard": ("update", "colour"),
            "checkerboard_bands": ("update", "colour", "change"),
        }
        return (*before.get(self.variant, (order, "update", "cell")), self.variant)

    @property
    def in_strips(self) -> bool:
        """Whether vectors run along strips."""
        return self.variant in ("wavefront_strips", "wavefront_images")

    def layout(self, shape: tuple[int, int]) -> Layout:
        """How an image must lie for this variant."""
        if self.variant.startswith("checkerboard"):
            return Layout.columns_apart(shape, self.lanes)
        margin = 2 if self.second_order else 1
        if not self.in_strips:
            return Layout.padded(shape, margin, margin)
        # The last strip may reach past the image; lanes lean out by a strip's height and a block.
        return Layout.padded(shape, -shape[0] % self.strip_rows + margin, self.strip_rows + self.lanes)


def _processors() -> int:
    """Processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)  # Linux only
    return len(affinity(0)) if affinity else os.cpu_count() or 1
