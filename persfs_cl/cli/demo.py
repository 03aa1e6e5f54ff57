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
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.solver.options import Options
from persfs_cl.solver.reconstruct import reconstruct

_DATA = Path(__file__).resolve().parent.parent / "data"
# How the skull was photographed: data/README.md. The camera and the lamp come from triangulated points; of the tone
# curve, which darkens what is dark, they say only that undoing it brings the surface nearer to them.
_SKULL_FOCAL_LENGTH = 1211.35
_SKULL_POINT = 151.0, 132.5
_SKULL_LAMP = 0.0, -0.067, 0.0
_SKULL_BRIGHTNESS = Brightness(tone_exponent=0.55)
_SKULL_ERODED = 3
_FOLDERS = {"vase", "skull"}
"""What an earlier demo has left."""
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
    """Reconstruct a bundled flash photograph of a skull, and the paper's synthetic vase. Needs no arguments."""
    check_folder(output, overwrite=False, own=_FOLDERS)
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
  It has no page to turn it on; the skull has.
""")

    folder = output / "skull"
    photo, mask = _DATA / "skull.png", _DATA / "skull_mask.png"
    job = Job(
        photo,
        CameraChoice(_SKULL_FOCAL_LENGTH, principal_point=_SKULL_POINT),
        _SKULL_BRIGHTNESS,
        mask=mask,
        mask_erode=_SKULL_ERODED,
        light=FlashLight(offset=_SKULL_LAMP),
        keywords={"device": keywords["device"]},
    )
    result = solve_photo(job)
    with writing():
        write(result, folder, EVERYTHING)
    prepared, original = result.prepared_residual, result.photo_residual
    typer.echo(f"""\
A modelled skull, a real photograph by the camera's flash, 320 x 280 pixels: {result.solution.iterations} iterations.
  Re-rendered, the surface differs, in grey levels of 255,
    from the prepared photograph, with its tone curve undone, by
                              here       ME {prepared.mean:.2f}, RS {prepared.root_mean_square:.2f}
    from the photograph itself, at the same white, by
                              here       ME {original.mean:.2f}, RS {original.root_mean_square:.2f}
                              the paper  ME {_PAPER_STATUE[0]}, RS {_PAPER_STATUE[1]} (another photograph, of a statue)
  Look at {folder / "relief.png"} and {folder / "comparison.png"}, and turn {folder / "mesh.ply"} in a mesh viewer.
  After 'make demo', '. .venv/bin/activate' puts persfs-cl on the path. The same by hand:
    persfs-cl reconstruct {shlex.quote(str(photo))} -o skull \\
      --mask {shlex.quote(str(mask))} --mask-erode {_SKULL_ERODED} \\
      --focal-length {_SKULL_FOCAL_LENGTH:g} --principal-point {_listed(_SKULL_POINT)} \\
      --light flash --lamp {_listed(_SKULL_LAMP)} \\
      --tone-exponent {_SKULL_BRIGHTNESS.tone_exponent:g}

What one photograph cannot tell was assumed: that the skull is matt and of one colour, though it shines a little and its
sutures are stained; that light comes from the flash alone, though the eye sockets light themselves up, which makes them
too shallow; and that the surface goes on behind brows and jaw, where it jumps. The grey levels above only say how well
the surface explains the photograph, not whether it is the right one.

Open {folder / "index.html"} in a browser to turn the skull with the mouse.""")


def _listed(numbers: tuple[float, ...]) -> str:
    return ",".join(f"{number:g}" for number in numbers)
