"""Options that come from the tables of lights and materials and from the description of the keywords."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, get_args

import pytest
import typer
from typer.testing import CliRunner, Result

import persfs_cl as ps
from persfs_cl.cli.choosers import signature, takes
from persfs_cl.cli.kinds import kind_chooser
from persfs_cl.cli.options import chosen_keywords
from persfs_cl.cli.reconstruct import reconstruct
from persfs_cl.shading.lights import LIGHTS
from persfs_cl.shading.materials import MATERIALS
from persfs_cl.solver.options import DESCRIBED


@dataclass(frozen=True)
class Velvet(ps.Lambertian):
    """A material that the command has never heard of."""

    summary: ClassVar[str] = "as of a curtain"

    pile: float = field(metadata={"help": "length of the hairs.", "metavar": "MM"})
    roughness: float = field(default=0.5, metadata={"help": "of their tips."})

    def __post_init__(self) -> None:
        if self.pile > 9:
            raise ps.InputError.about("pile", self.pile, "is too long: give 9 at most.")


def showing(chooser: Callable[..., Any]) -> Callable[..., Result]:
    """A command that prints what a chooser has chosen."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)

    @app.command()
    @takes(thing=chooser)
    def show(*, before: int = 1, thing: Any) -> None:
        typer.echo(f"{before} {thing!r}")

    return lambda *texts: CliRunner(env={"COLUMNS": "300", "TERM": "dumb"}).invoke(app, list(texts))


def test_a_new_material_has_its_options() -> None:
    run = showing(kind_chooser("reflectance", {**MATERIALS, "velvet": Velvet}, "Material", naming=True))
    said = " ".join(run("--help").output.split())
    assert "phong: with a highlight, as wet tissue. velvet: as of a curtain." in said
    assert "--pile MM Of velvet, which needs it: length of the hairs." in said
    assert "Of oren-nayar, which needs it, and velvet: spread of the slopes" in said
    assert run().output == "1 Lambertian()\n"
    assert run("--before=2", "--reflectance=velvet", "--pile=3").output == "2 Velvet(pile=3.0, roughness=0.5)\n"
    assert run("--reflectance=velvet", "--pile=3", "--roughness=1").output == "1 Velvet(pile=3.0, roughness=1.0)\n"
    assert run("--reflectance=oren-nayar", "--roughness=1").output == "1 OrenNayar(roughness=1.0)\n"


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (("--reflectance=velvet",), ("--pile", "velvet needs it: length of the hairs.")),
        (("--reflectance=oren-nayar",), ("--roughness", "oren-nayar needs it: spread of the slopes")),
        (
            ("--pile=1",),
            ("--pile", "goes with --reflectance velvet, not lambertian: add --reflectance velvet, or leave it out."),
        ),
        (("--roughness=1",), ("--roughness", "goes with --reflectance oren-nayar or velvet, not lambertian")),
        (("--reflectance=velvet", "--pile=10"), ("--pile", "is too long: give 9 at most.")),
        (("--reflectance=silk",), ("silk", "lambertian", "velvet")),
    ],
)
def test_what_a_material_cannot_have_is_refused(texts: tuple[str, ...], words: tuple[str, ...]) -> None:
    outcome = showing(kind_chooser("reflectance", {**MATERIALS, "velvet": Velvet}, "Material"))(*texts)
    assert outcome.exit_code == 2
    assert all(word in outcome.output for word in words)


@pytest.mark.parametrize(
    ("texts", "light"),
    [
        ((), ps.ParallelLight()),
        (("--p0=0.5",), ps.ParallelLight(0.5)),
        (("--light=flash",), ps.FlashLight()),
        (("--light=flash", "--no-falloff", "--gain=2"), ps.FlashLight(falloff=False, gain=2.0)),
        (("--light=flash", "--falloff", "--lamp=1,45deg,0"), ps.FlashLight(offset=(1.0, 0.9999999999999999, 0.0))),
    ],
)
def test_lights_come_from_their_table(texts: tuple[str, ...], light: object) -> None:
    assert showing(kind_chooser("light", LIGHTS, "Light"))(*texts).output == f"1 {light!r}\n"


def test_choices_and_defaults_are_those_of_the_library() -> None:
    options, library = signature(chosen_keywords), inspect.signature(ps.reconstruct).parameters
    told = {name: option for name, (_, option) in DESCRIBED.items() if option.in_command}
    assert options.keys() == told.keys()
    assert options.keys() >= {"surface", "boundary", "scheme", "ordering", "max_iterations", "tolerance", "device"}
    for name, option in told.items():
        assert options[name].default == library[name].default
        if option.choices:
            kind, typed = get_args(options[name].annotation)
            words = get_args(kind) or tuple(typed.metavar.strip("<>").split("|"))
            assert words == tuple(option.choices())
    assert options.keys() < signature(reconstruct).keys()
