"""``persfs-cl demo``: the main job on bundled input."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from persfs_cl.cli.options import CameraOptions, DeviceOption
from persfs_cl.cli.output import check_folder, filling
from persfs_cl.cli.photo import Brightness
from persfs_cl.cli.reconstruct import reconstruct_photo
from persfs_cl.metrics import compare
from persfs_cl.scenes import vase
from persfs_cl.solver import reconstruct

_DATA = Path(__file__).resolve().parent.parent / "data"
# Chosen by eye. The camera of the museum is not known: eight image widths away, perspective hardly matters. On this
# worn metal the brightest two fifths are taken for matt surface that faces the light.
_COIN_FOCAL_LENGTH = 576.0
_COIN_BRIGHTNESS = Brightness(clip_highlights=60.0, mean_filter=3)
_PAPER_VASE = "0.0272", "0.0559"
_VASE_ITERATIONS = 30


def demo(
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for the results; an earlier demo's are replaced."),
    ] = Path("demo-output"),
    device: DeviceOption = None,
) -> None:
    """Reconstruct a bundled photograph of a coin, and the paper's synthetic vase. Needs no arguments."""
    check_folder(output, overwrite=True)
    folder = output / "vase"
    scene = vase()
    solution = reconstruct(
        scene.image,
        scene.camera,
        mask=scene.mask,
        known_depth=scene.known_depth,
        surface=scene.surface,
        max_iterations=_VASE_ITERATIONS,
        device=device,
    )
    errors = compare(solution.depth, scene.depth, align="range")
    with filling(folder) as temporary:
        solution.save(temporary)
    typer.echo(f"""\
The paper's vase, a synthetic image with known depth (eq. (13), {solution.iterations} iterations, background known):
  height, both scaled to [0, 1]:   here ME {errors.mean:.4f}, RS {errors.root_mean_square:.4f}
                              the paper ME {_PAPER_VASE[0]}, RS {_PAPER_VASE[1]}
  look at {folder / "relief.png"} and {folder / "depth.png"}
""")

    folder = output / "coin"
    photo, mask = _DATA / "coin.png", _DATA / "coin_mask.png"
    solution, _ = reconstruct_photo(
        photo,
        folder,
        CameraOptions(_COIN_FOCAL_LENGTH, None, None),
        _COIN_BRIGHTNESS,
        mask=mask,
        surface="toward",
        device=device,
    )
    grey = solution.grey_errors()
    typer.echo(f"""\
A Greek coin from Pompeii, a real photograph of 72 x 72 pixels ({solution.iterations} iterations):
  photographed again, grey levels: here ME {grey.mean:.2f}, RS {grey.root_mean_square:.2f}
          the paper, another photograph ME 6.07, RS 13.72
  look at {folder / "relief.png"} and {folder / "comparison.png"}; {folder / "mesh.ply"} opens in a mesh viewer
  the same by hand: persfs-cl reconstruct {photo} -o coin --mask {mask} --focal-length {_COIN_FOCAL_LENGTH:g}
    --clip-highlights {_COIN_BRIGHTNESS.clip_highlights:g} --mean-filter {_COIN_BRIGHTNESS.mean_filter} --surface toward

What one photograph cannot tell, and was assumed here: that the coin is matt, of one colour and lit from the camera's
side (light from elsewhere turns one flank of a relief into a slope); that it rises towards the camera from its rim,
for a hollow gives the same picture; that its rim lies flat. A dip within the relief comes out as a peak. Depth is in
units of the distance to the rim, and no true depth of this coin is known: the grey levels above only say how well the
surface explains the photograph.
""")
