"""The command ``persfs-cl``: parse, call, print. One module a command."""

from __future__ import annotations

import re
import shlex
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import persfs_cl
from persfs_cl.cli.config import ConfiguredCommand, bare_flags
from persfs_cl.cli.interrupts import answered, raising
from persfs_cl.cli.signals import leave_at_once
from persfs_cl.cli.spelling import WrongOption, meant_by, spelling
from persfs_cl.cli.status import INPUT_FAILED, INTERRUPTED
from persfs_cl.errors import DeviceError, PersfsError, spelled
from persfs_cl.wording import Spelling, brief

_NO_DEVICE = 3

_EPILOG = """[bold]Exit status[/bold]

0: done. 1: an input could not be used, or a result not be written, or standard output not take what was to be printed;
standard error says which and why. 2: the command line is wrong. 3: no usable OpenCL device.
130: interrupted by Ctrl-C, or by the signals SIGTERM or SIGHUP, which do the same.
"""
_RECONSTRUCT_EPILOG = """[bold]Examples[/bold]

persfs-cl reconstruct photo.jpg -o result --mask object.png

persfs-cl reconstruct statue.png -o result --focal-length 590 --mean-filter 3 --surface toward

persfs-cl reconstruct coin.tiff -o result --fov 7 --p0 0.2 --clip-highlights 95 --overwrite

persfs-cl reconstruct endoscope.png -o result --light flash --fov 90 --channel red --highlights fill --mask view.png

persfs-cl reconstruct photo.jpg -o result --config camera.toml --config flash.toml

persfs-cl reconstruct photo.jpg -o result --save depth,normals.npy,mesh.glb --mesh-faces 50000

[bold]Output[/bold]

The paths of the files written go to standard output, one a line; everything else goes to standard error.

Ctrl-C ends the iteration: what there is by then is written, report.json says STOPPED, and the exit status is 130.
During the preparation it ends the program at once. While results are written it leaves out pictures and previews;
depth, mesh and report are kept. Pressed again, it ends the program without them. SIGTERM and SIGHUP do the same.
"""
_BATCH_EPILOG = """[bold]Examples[/bold]

persfs-cl batch photos -o results --light flash --fov 60 --dry-run

persfs-cl batch 'photos/**/*.jpg' -o results --light flash --cameras sparse/cameras.txt --masks masks

persfs-cl batch photos -o results --config flash.toml --device all --save depth.tiff,report

cd photos && find . -name '*.tif' | persfs-cl batch - -o ../results --config ../flash.toml

persfs-cl batch photos -o results --config flash.toml --shard 2/8

[bold]Output[/bold]

The folders of the photos that are done go to standard output, one a line; everything else goes to standard error. What
failed is listed at the end, and the exit status is then 1; the others are done all the same. It is 1 too where a file
that was asked for could not be made of a surface, such as a solid of single pixels, by this run or an earlier one. 2:
the command line is wrong. 3: no device is left. 130: interrupted.

Ctrl-C, SIGTERM and SIGHUP drop what is in hand; what is complete stays, and is counted. Whatever ends a run, the power
included, the same command goes on from there.
"""
_RENDER_EPILOG = """[bold]Example[/bold]

persfs-cl render result/depth.npy -o image.png --focal-length 590 --p0 0.3

persfs-cl render result/depth.npy -o image.png --focal-length 590 --light flash --reflectance oren-nayar --roughness 0.3

The path of the image goes to standard output.
"""
_COMPARE_EPILOG = """[bold]Examples[/bold]

persfs-cl compare result/depth.npy truth.npy --align scale

persfs-cl compare one/rendered.png other/rendered.png --mask object.png --json

persfs-cl compare result/depth.npy triangulated.csv --align scale --photo photo.jpg
"""
_BENCH_EPILOG = """[bold]Examples[/bold]

persfs-cl bench --quick

persfs-cl bench --experiment orderings --experiment roofline --sizes 2048

persfs-cl bench --experiment batch --batch 1,64 --orderings wavefront --device gpu

Ctrl-C keeps what was measured: the files are written, and the exit status is 130.
"""
_CALIBRATE_EPILOG = """[bold]Examples[/bold]

persfs-cl calibrate photo.jpg points.csv -o light.toml --light flash --fov 60 --fit gain,exponent

persfs-cl calibrate near.png near.npy far.png far.npy -o light.toml --light flash --focal-length 590 --fit gain,lamp

persfs-cl calibrate board.tif board.npy -o sun.toml --light parallel --fov 40 --fit direction,white

persfs-cl reconstruct another.jpg -o result --config light.toml

[bold]Output[/bold]

The path of the file goes to standard output, and what was found to standard error.
"""
_DEVICES_EPILOG = """[bold]Examples[/bold]

persfs-cl devices

persfs-cl devices --check --json > devices.json

persfs-cl devices --check --quick --device gpu

The second is what a report of a fault should come with. Each device is tested by a process of its own, so that a driver
that crashes or hangs is reported, as is one that computes something else; the exit status is then 1.
"""
_PAPER_EPILOG = """[bold]Examples[/bold]

persfs-cl paper -o result

persfs-cl paper --quick

It needs numba: pip install 'persfs-cl[paper]'.

Ctrl-C keeps the tables that are finished; the exit status is 130.
"""
_EPILOGS = {
    "reconstruct": _RECONSTRUCT_EPILOG,
    "batch": _BATCH_EPILOG,
    "render": _RENDER_EPILOG,
    "compare": _COMPARE_EPILOG,
    "calibrate": _CALIBRATE_EPILOG,
    "paper": _PAPER_EPILOG,
    "bench": _BENCH_EPILOG,
    "devices": _DEVICES_EPILOG,
    "demo": "",
}
"""Of each command: a module of this room, with a function of its name."""


class _Commands(TyperGroup):
    """Says what a user can mend in a line or two; everything else keeps its traceback.

    Commands are imported when they are called, or listed: nobody waits for what the others need.
    """

    def list_commands(self, ctx: Any) -> list[str]:
        del ctx  # the same for all
        return list(_EPILOGS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        # A name that is wrong is compared with all.
        for name in [cmd_name] if cmd_name in _EPILOGS else _EPILOGS:
            if name not in self.commands:
                self.commands[name] = _command(name)
        return super().get_command(ctx, cmd_name)

    def get_params(self, ctx: Any) -> list[Any]:
        return bare_flags(super().get_params(ctx))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name = args[0]
        if name not in _EPILOGS and not ctx.resilient_parsing:
            place = Path(name)
            if place.is_dir():
                ctx.fail(f"{name} is no command. For a folder: persfs-cl batch {shlex.quote(name)} -o results")
            if place.is_file() or place.suffix:
                ctx.fail(f"{name} is no command. For a photo: persfs-cl reconstruct {shlex.quote(name)} -o result")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        try:
            with raising(), self._warnings(ctx):
                return super().invoke(ctx)
        except WrongOption as error:
            error.word(self._spelling(ctx))
            raise
        except typer.BadParameter as error:
            error.message = _with_value(error)
            if error.param is not None:
                # Told in quotes, before those that it takes.
                word = error.message.partition("'")[2].partition("'")[0]
                error.message += meant_by(error.param.name, word)
                if re.fullmatch(r"[-+]?\d+,\d+", word):
                    error.message += f" Write {word.replace(',', '.')}, with a point."
            raise
        except PersfsError as error:
            typer.echo(f"persfs-cl: {self._worded(ctx, error)}", err=True)
            raise typer.Exit(_NO_DEVICE if isinstance(error, DeviceError) else INPUT_FAILED) from error
        except UserWarning as error:
            # An error by the option -W of Python, or by PYTHONWARNINGS.
            typer.echo(f"persfs-cl: {self._worded(ctx, error)}", err=True)
            raise typer.Exit(INPUT_FAILED) from error
        except KeyboardInterrupt as error:
            typer.echo("persfs-cl: interrupted.", err=True)
            raise typer.Exit(INTERRUPTED) from error

    @contextmanager
    def _warnings(self, ctx: Any) -> Iterator[None]:
        """Warnings of the library as lines of the command; others, which are for developers, as Python has them."""
        usual = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any, **where: Any) -> None:
            if issubclass(category, UserWarning):
                typer.echo(f"persfs-cl: warning: {self._worded(ctx, message)}", err=True)
            else:
                usual(message, category, *place, **where)

        with warnings.catch_warnings():
            warnings.showwarning = show
            yield

    def _worded(self, ctx: Any, message: Warning | Exception | str) -> str:
        return spelled(message, self._spelling(ctx))

    def _spelling(self, ctx: Any) -> Spelling:
        return spelling(self.commands[ctx.invoked_subcommand].params)


_NO_NUMBER = {"Input should be a valid number": "number", "Input should be a valid integer": "whole number"}
"""How pydantic begins, and what the text is not."""


def _with_value(error: typer.BadParameter) -> str:
    """The message of a wrong option, with its value: pydantic's words, which some versions of typer have, lack it."""
    message = error.message.removeprefix("Value error, ")
    told: list[dict[str, Any]] = getattr(error.__cause__, "errors", list)()
    if not message.startswith("Input should") or not told:
        return message
    if isinstance(text := told[0]["input"], str) and message.startswith(tuple(_NO_NUMBER)):
        return f"{brief(text)} is no {next(kind for start, kind in _NO_NUMBER.items() if message.startswith(start))}."
    return f"{told[0]['input']} was given, and it {message.removeprefix('Input ')}."


def _paragraphs(text: str) -> str:
    """The text with its lines joined, because some versions of typer keep line ends and others do not."""
    return "\n\n".join(" ".join(part.split()) for part in text.split("\n\n"))


app = typer.Typer(
    name="persfs-cl",
    cls=_Commands,
    help="Shape from one shaded photograph, on any OpenCL device.",
    epilog=_paragraphs(_EPILOG),
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _command(name: str) -> Any:
    """A command by its name."""
    with answered(leave_at_once):
        function = getattr(import_module(f"persfs_cl.cli.{name}"), name)
    alone = typer.Typer(add_completion=False, rich_markup_mode="rich", pretty_exceptions_enable=False)
    text, epilog = _paragraphs(function.__doc__ or ""), _paragraphs(_EPILOGS[name])
    alone.command(name, cls=ConfiguredCommand, help=text, epilog=epilog)(function)
    return typer.main.get_command(alone)


@app.callback(invoke_without_command=True)
def _options(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose", help="With --version: packages, devices and settings too, for the report of a fault."
        ),
    ] = False,
) -> None:
    if verbose and not version:
        raise typer.BadParameter("goes with --version: leave it out.", param_hint="'--verbose'")
    if version and verbose:
        from persfs_cl.cli.about import about  # noqa: PLC0415  # it looks for devices

        typer.echo(about())
        raise typer.Exit
    if version:
        typer.echo(f"persfs-cl {persfs_cl.__version__}")
        raise typer.Exit
    if ctx.invoked_subcommand is None:
        raise typer.BadParameter("name a command; persfs-cl --help lists them.")
