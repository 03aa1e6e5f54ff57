"""``persfs-cl demo``: the main job on bundled input."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from persfs_cl.cli.choosers import takes
from persfs_cl.cli.options import chosen_device
from persfs_cl.cli.output import check_folder
from persfs_cl.cli.progress import writing
from persfs_cl.metrics import compare
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.job import Job, solve_photo
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.results import EVERYTHING, write
from persfs_cl.scenes.analytic import vase
from persfs_cl.solver.options import Options
from persfs_cl.solver.reconstruct import reconstruct

_DATA = Path(__file__).resolve().parent.parent / "data"
# Chosen by eye. The museum's camera is not known; from eight image widths away perspective hardly matters. The metal
# shines: what is brighter than three fifths of the coin is taken for matt surface that faces the light.
_COIN_FOCAL_LENGTH = 576.0
_COIN_BRIGHTNESS = Brightness(clip_highlights=60.0, mean_filter=3)
# Tables 1 and 2, after 30 iterations of the paper's scheme.
_PAPER_VASE = "0.0272", "0.0559"
_PAPER_STATUE = "6.0667", "13.7159"


@takes(keywords=chosen_device)
def demo(
    *,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for the results; an earlier demo's are replaced."),
    ] = Path("demo-output"),
    keywords: Options,
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
        device=keywords["device"],
    )
    errors = compare(solution.depth, scene.depth, align="range")
    with writing():
        solution.save(folder, folder=True)
    typer.echo(f"""\
The paper's vase, a synthetic image of known depth: {solution.iterations} iterations, background and frame known.
  Height, scaled to [0, 1]:   here       ME {errors.mean:.4f}, RS {errors.root_mean_square:.4f}
                              the paper  ME {_PAPER_VASE[0]}, RS {_PAPER_VASE[1]} (depth offset not stated)
  Look at {folder / "relief.png"}: as only what lies around it is known, the vase is found as a hollow.
""")

    folder = output / "coin"
    photo, mask = _DATA / "coin.png", _DATA / "coin_mask.png"
    job = Job(
        photo,
        CameraChoice(_COIN_FOCAL_LENGTH),
        _COIN_BRIGHTNESS,
        mask=mask,
        keywords={"surface": "toward", "device": keywords["device"]},
    )
    result = solve_photo(job)
    with writing():
        write(result, folder, EVERYTHING)
    prepared, original = result.prepared_residual, result.photo_residual
    typer.echo(f"""\
A Greek coin from Pompeii, a real photograph of 72 x 72 pixels: {result.solution.iterations} iterations.
  Re-rendered, the surface differs, in grey levels of 255,
    from the prepared photograph, with its highlights clipped and smoothed, by
                              here       ME {prepared.mean:.2f}, RS {prepared.root_mean_square:.2f}
    from the photograph itself, at the same white, by
                              here       ME {original.mean:.2f}, RS {original.root_mean_square:.2f}
                              the paper  ME {_PAPER_STATUE[0]}, RS {_PAPER_STATUE[1]} (another photograph, of a statue)
  Look at {folder / "relief.png"} and {folder / "comparison.png"}, and turn {folder / "mesh.ply"} in a mesh viewer.
  The same by hand:
    persfs-cl reconstruct {shlex.quote(str(photo))} -o coin \\
      --mask {shlex.quote(str(mask))} --surface toward --focal-length {_COIN_FOCAL_LENGTH:g} \\
      --clip-highlights {_COIN_BRIGHTNESS.clip_highlights:g} --mean-filter {_COIN_BRIGHTNESS.mean_filter}

What one photograph cannot tell was assumed: that the coin is matt, of one colour, and lit from where the camera is
(a lamp to one side would darken the far flank of every bump, which is taken for a slope here); that its edge lies
flat; and that it rises from there, for a hollow gives the same image. Details within come out as bumps upon bumps:
no dip is ever found. The true depth of this coin is not known. The grey levels above only say how well the surface
explains the photograph, not whether it is the right one.

Open {folder / "index.html"} in a browser to turn the coin with the mouse.""")
