"""Whether a device works at all: asked when it failed at a photo, to know which of them is to blame."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from persfs_cl._cl.device import Device
from persfs_cl.camera import Camera
from persfs_cl.errors import DeviceError, InputError, KernelBuildError, PersfsError
from persfs_cl.solver.options import Options
from persfs_cl.solver.problem import prepare
from persfs_cl.solver.solve import solve
from persfs_cl.told import hearing

_SIZE = 8
_ITERATIONS = 2


def trouble(device: Device, options: Options) -> PersfsError | None:
    """Why a device cannot solve even the smallest image; None where it can.

    Parameters
    ----------
    device : Device
    options : Options
        Complete: the kernels are those that photos will need, but for coarser grids, and are compiled by this.
    """
    image = np.tile(np.linspace(0.4, 0.8, _SIZE), (_SIZE, 1))
    few: Options = {**options, "max_iterations": _ITERATIONS}
    with hearing():
        try:
            # What refuses the image is no fault of the device.
            with suppress(InputError):
                solve(device, [prepare(image, Camera(float(_SIZE)), None, None, None, options=few)], few, None)
        except (DeviceError, KernelBuildError) as error:
            return error
    return None
