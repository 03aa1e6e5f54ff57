"""Options from files, and files from options."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
import tomlkit
import typer
from command import FOCAL, HEIGHT, SCENE, WIDTH, names, png, run, strict
from hypothesis import example, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from persfs_cl.cli.app import _command
from persfs_cl.cli.config import ConfiguredCommand, configurable

COMMAND = _command("reconstruct")


def written(path: Path, *lines: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def parsed(*arguments: str) -> dict[str, Any]:
    """What the parameters of ``reconstruct`` are for a command line."""
    values = COMMAND.make_context("reconstruct", ["photo.png", "-o", "out", *arguments]).params
    return {name: value for name, value in values.items() if name != "config"}


def printed(*arguments: str | Path) -> str:
    outcome = run("reconstruct", *arguments, "--dump-config")
    assert (outcome.status, outcome.stderr) == (0, "")
    return outcome.stdout


@pytest.mark.usefixtures("quick")
def test_a_file_says_what_the_command_line_may_say_otherwise(photo: Path, tmp_path: Path) -> None:
    file = written(
        tmp_path / "a.toml", f"focal-length = [{WIDTH}, {WIDTH + 1}]", "max_iterations = 2", 'scheme="upwind"'
    )
    assert run("reconstruct", photo, "-o", tmp_path / "one", "--config", file).status == 0
    report = strict(tmp_path / "one" / "report.json")
    assert report["requested"]["focal_length"] == [WIDTH, WIDTH + 1]
    assert (report["iterations"], report["parameters"]["scheme"]) == (2, "upwind")

    run("reconstruct", photo, "-o", tmp_path / "two", "--config", file, "--max-iterations=1", *FOCAL)
    report = strict(tmp_path / "two" / "report.json")
    assert (report["iterations"], report["requested"]["focal_length"]) == (1, WIDTH)


@pytest.mark.usefixtures("quick")
def test_paths_start_at_the_folder_of_the_file(photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path / "scans" / "a.toml", 'mask = "mask.png"', 'ambient = "dark.png"', f"focal-length = {WIDTH}")
    png(tmp_path / "scans" / "mask.png", np.pad(np.ones((HEIGHT - 2, WIDTH - 2)), 1))
    png(tmp_path / "scans" / "dark.png", 0 * SCENE.image)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert run("reconstruct", photo, "-o", "out", "--config", "../scans/a.toml").status == 0
    said = strict(Path("out/report.json"))["photo"]
    assert [Path(said[name]) for name in ("mask", "ambient")] == [Path("../scans/mask.png"), Path("../scans/dark.png")]

    values = tomlkit.parse(printed("--config=../scans/a.toml", "--walls=walls.png", "--vignetting=cos4"))
    assert Path(values["mask"]).samefile(tmp_path / "scans" / "mask.png")
    assert Path(values["walls"]) == tmp_path / "elsewhere" / "walls.png"
    assert Path(values["ambient"]).is_absolute()
    assert values["vignetting"] == "cos4"


@pytest.mark.parametrize(
    ("line", "arguments", "left"),
    [
        ('cameras = "c.csv"', ("--fov", "50"), "fov = 50.0"),
        ("fov = 50", ("--cameras", "c.csv"), f'cameras = "{Path.cwd() / "c.csv"}"'),
        ('masks = "m"', ("--mask", "m.png"), f'mask = "{Path.cwd() / "m.png"}"'),
        ("overwrite = true", ("--retry-failed",), "retry-failed = true"),
    ],
)
def test_what_is_given_sets_its_alternatives_aside(
    line: str, arguments: tuple[str, ...], left: str, tmp_path: Path
) -> None:
    outcome = run("batch", "--config", written(tmp_path / "a.toml", line), *arguments, "--dump-config")
    assert outcome.status == 0
    assert [each for each in outcome.stdout.splitlines() if each and not each.startswith("#")] == [left]


def test_a_scheduler_may_be_a_file_or_an_address(tmp_path: Path) -> None:
    for said, meant in (("s.json", str(tmp_path / "s.json")), ("tcp://host:8786", "tcp://host:8786")):
        outcome = run("batch", "--config", written(tmp_path / "a.toml", f'scheduler = "{said}"'), "--dump-config")
        assert f'\nscheduler = "{meant}"\n' in outcome.stdout


def test_a_later_file_wins_name_by_name(tmp_path: Path) -> None:
    first = written(tmp_path / "first.toml", "focal-length = 590", "tolerance = 1e-3", 'light = "flash"')
    second = written(tmp_path / "second.toml", "fov = 40", "tolerance = 1", "falloff = false")
    values = tomlkit.parse(printed("--config", first, "--config", second)).unwrap()
    assert values == {"fov": 40.0, "tolerance": 1.0, "light": "flash", "falloff": False}
    values = tomlkit.parse(printed("--config", second, "--config", first, "--tolerance=1e-05", "--falloff")).unwrap()
    assert values == {"focal-length": 590, "tolerance": 1e-5, "light": "flash", "falloff": True}
    # Both say what the camera sees: the command line leaves no room for the file.
    values = tomlkit.parse(printed("--config", first, "--fov=50")).unwrap()
    assert values == {"fov": 50.0, "tolerance": 1e-3, "light": "flash"}


REFUSED = {
    "unknown, with a near name": (
        "focal-lenght = 590",
        "focal-lenght = 590: there is no such option. Is it focal-length? --dump-config lists all",
    ),
    "unknown": ("zzz = 1", "zzz = 1: there is no such option. --dump-config lists all"),
    "a table": ("[lens]\nfov = 30", "lens = fov = 30: there is no such option."),
    "a list of tables": ("[[lens]]\nfov = 30", "there is no such option."),
    "tables in a list": ("walls = [{a = 1}]", "give a text."),
    "endless digits": (f"max-iterations = {'9' * 5000}", "a.toml"),
    "negated": ("no-falloff = true", "no-falloff = true: there is no such option. Is it falloff?"),
    "an argument": ('photo = "a.png"', 'photo = "a.png": that is said on the command line alone. Take it out.'),
    "the folder of results": ('output = "a"', 'output = "a": that is said on the command line alone.'),
    "another file": ('config = "b.toml"', "that is said on the command line alone."),
    "twice": ("max-iterations = 3\nmax_iterations = 4", "max_iterations = 4: max-iterations stands there twice."),
    "text for a number": ('tolerance = "small"', 'tolerance = "small": give a number.'),
    "truth for a number": ("tolerance = true", "tolerance = true: give a number."),
    "fraction for a count": ("max-iterations = 2.5", "max-iterations = 2.5: give a whole number."),
    "a light by another name": ('light = "sun"', 'give one of "parallel", "flash". Give --light parallel, and its'),
    "number for a flag": ("overwrite = 1", "overwrite = 1: give true or false."),
    "number for a path": ("walls = 3", "walls = 3: give a text."),
    "list for a path": ('walls = ["a.png", "b.png"]', 'walls = ["a.png", "b.png"]: give a text.'),
    "date": ("focal-length = 2020-01-01", "focal-length = 2020-01-01: give a text or a number, or a list"),
    "nothing": ("focal-length = []", "focal-length = []: give a text or a number, or a list"),
    "no choice": ('channel = "violet"', 'channel = "violet": give one of "luminance", "red", "green"'),
    "no choice of a keyword": ('scheme = "fast"', 'scheme = "fast": --scheme fast is unknown: choose "auto"'),
    "out of bounds": ("max-iterations = 0", "max-iterations = 0: --max-iterations 0 is not possible: give a whole"),
    "even": ("mean-filter = 4", "mean-filter = 4: 4 has no middle pixel: give an odd number."),
    "endless": ("saturation = inf", "saturation = inf: inf is not a finite number above 0."),
    "too large for a float": (f"fov = 1{'0' * 400}", "give a smaller number."),
    "impossible light": ("ambient = -1", "ambient = -1: -1 is no brightness"),
    "no TOML": ("fov = 30\nscheme = upwind", 'at line 2 col 9. Text stands in quotes: scheme = "upwind"'),
    "no TOML at all": ("fov 30", "A line of it is such as focal-length = 590."),
    "the same twice": ("fov = 30\n\nfov = 40", 'Key "fov" already exists. at line 3'),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_a_file_cannot_say(case: str, photo: Path, tmp_path: Path) -> None:
    text, message = REFUSED[case]
    file = written(tmp_path / "a.toml", text)
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", "--config", file)
    assert (outcome.status, outcome.stdout) == (2, "")
    assert f"Invalid value for '--config': {file}" in outcome.stderr
    assert message in outcome.stderr
    assert names(tmp_path) == {"a.toml", photo.name}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot be read: No such file or directory."),
        (b"fov = 30\nlight = '\xff'", "is no text in UTF-8, in line 2."),
        (b"#" * 2**21, "is larger than any file of options."),
    ],
)
def test_what_is_no_file_of_options(content: bytes | None, message: str, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / "a.toml").write_bytes(content)
    outcome = run("reconstruct", "photo.png", "-o", tmp_path / "out", "--config", tmp_path / "a.toml")
    assert outcome.status == 2
    assert f"{tmp_path / 'a.toml'} {message}" in outcome.stderr
    # Whoever asks for help gets it.
    assert run("reconstruct", "--help", "--config", tmp_path / "a.toml").status == 0


@pytest.mark.parametrize(
    ("lines", "arguments", "message"),
    [
        (("gain = 2",), (), "leave it out. (From {}: gain = 2.)"),
        (
            ('light = "flash"', "gain = 2"),
            ("--p0=1",),
            'parallel, not flash: give --light parallel, or leave it out. (From {}: light = "flash".)',
        ),
        (('scheme = "upwind"',), ("--boundary=outflow",), 'or --scheme lax-friedrichs. (From {}: scheme = "upwind".)'),
        (("focal-length = 5", "fov = 5"), (), "not both. (From {0}: focal-length = 5; {0}: fov = 5.)"),
        (("tolerance = 1",), ("--p0=wide",), ""),
    ],
)
def test_an_option_that_does_not_fit_is_traced_to_its_file(
    lines: tuple[str, ...], arguments: tuple[str, ...], message: str, photo: Path, tmp_path: Path
) -> None:
    file = written(tmp_path / "a.toml", *lines)
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", "--config", file, *arguments)
    assert outcome.status == 2
    assert message.format(file) in outcome.stderr
    assert ("From" in outcome.stderr) == bool(message)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--resting=1e-6", "--scheme=lax-friedrichs"), "--resting 1e-06 with --scheme lax-friedrichs"),
        (("--light=flash", "--normalise=level"), "under a flash nothing is normalised"),
        (("--gain=2",), "add --light flash"),
    ],
)
@pytest.mark.parametrize("command", ["reconstruct", "batch"])
def test_no_file_of_options_that_contradict_each_other_is_printed(
    command: str, options: tuple[str, ...], message: str
) -> None:
    outcome = run(command, *options, "--dump-config")
    assert (outcome.status, outcome.stdout) == (2, "")
    assert message in outcome.stderr


def test_what_options_still_lack_may_be_given_with_their_file() -> None:
    outcome = run("reconstruct", "--light=flash", "--gain=unknown", "--camera=none.json", "--dump-config")
    assert outcome.status == 0
    assert 'gain = "unknown"' in outcome.stdout


def test_the_file_that_is_printed_is_a_template() -> None:
    text = printed("--fov=30", "--max-iterations=2000", "--light=flash", "--device=0")
    values = tomlkit.parse(text).unwrap()
    assert values == {"fov": 30.0, "light": "flash", "device": 0}
    lines = text.splitlines()
    assert "# Horizontal field of view, instead of the focal length." in lines[lines.index("fov = 30.0") - 1]
    assert "# Camera" in lines[: lines.index("fov = 30.0")]
    assert {"#max-iterations = 2000", '#scheme = "auto"', '#walls = "FILE"', "#overwrite = false"} <= {*lines}
    assert max(map(len, lines)) <= 120

    # Every option is there once, and is known by its name there.
    unset = [line[1:] for line in lines if line.startswith("#") and line[1:2].isalpha()]
    offered = {**tomlkit.parse("\n".join(unset)).unwrap(), **values}
    options = {option.lstrip("-") for each in COMMAND.params for option in each.opts}
    assert offered.keys() == options - {"photo", "output", "o", "config", "dump-config"}


def test_defaults_in_the_template_are_the_defaults(tmp_path: Path) -> None:
    lines = [line[1:] for line in printed().splitlines() if line.startswith("#") and line[1:2].isalpha()]
    defaults = {line for line in lines if not any(letter.isupper() or letter == "|" for letter in line)}
    assert len(defaults) > 12
    file = written(tmp_path / "a.toml", *(defaults - {"falloff = true"}))
    assert parsed("--config", str(file)) == parsed()


@pytest.mark.skipif(sys.platform != "linux", reason="file names are texts elsewhere")
def test_a_path_that_is_no_text_cannot_be_printed() -> None:
    outcome = run("reconstruct", "--dump-config", "--mask", os.fsdecode(b"\xff.png"))
    assert outcome.status == 2
    assert "has bytes that are no text, which TOML does not hold: name the file otherwise." in outcome.stderr


TEXTS = st.text(st.characters(exclude_categories=("Cs", "Cc")), min_size=1).filter(lambda text: text[0] not in "-~")
NUMBERS = st.floats(0.0, 1e6).map(str) | st.integers(0, 10**20).map(str)
OPTIONS: dict[str, st.SearchStrategy[str]] = {
    "--overwrite": st.just(""),
    "--focal-length": NUMBERS | st.tuples(NUMBERS, NUMBERS).map(",".join) | TEXTS,
    "--principal-point": NUMBERS | TEXTS,
    "--light": st.sampled_from(["parallel", "flash"]),
    "--p0": NUMBERS,
    "--falloff": st.just(""),
    "--no-falloff": st.just(""),
    "--lamp": st.just("0,-5deg,0") | TEXTS,
    "--ambient": NUMBERS | st.just("/dark.png"),
    "--vignetting": st.sampled_from(["none", "cos4", "/plate.png"]),
    "--mean-filter": st.integers(0, 10**6).map(lambda half: str(2 * half + 1)),
    "--normalise": st.sampled_from(["linear", "grey", "none"]),
    "--mask": TEXTS.map(lambda text: f"/{text}"),
    "--scheme": st.sampled_from(["auto", "upwind", "lax-friedrichs"]),
    "--max-iterations": st.integers(1, 10**9).map(str),
    "--tolerance": st.floats(0.0, 1e300).map(str),
    "--max-slope": st.floats(1e-300, 1e6).map(str),
    "--device": NUMBERS | TEXTS,
}


@settings(max_examples=15)
@example([("--mask", "/a/")])
@given(st.lists(st.sampled_from(sorted(OPTIONS)).flatmap(lambda name: OPTIONS[name].map(lambda text: (name, text)))))
def test_what_is_printed_means_the_same_when_it_is_read(
    tmp_path_factory: pytest.TempPathFactory, options: list[tuple[str, str]]
) -> None:
    given_ = [f"{name}={text}" if text else name for name, text in options]
    file = tmp_path_factory.getbasetemp() / "printed.toml"
    with pytest.MonkeyPatch.context() as patch:
        # Most of these would be refused.
        patch.setattr(ConfiguredCommand, "_require_usable", lambda *_: None)
        text = printed(*given_)
        file.write_text(text, encoding="utf-8")
        assert parsed("--config", str(file)) == parsed(*given_)
        assert printed("--config", file) == text


def test_any_command_may_read_files(tmp_path: Path) -> None:
    other = typer.Typer(add_completion=False, pretty_exceptions_enable=False)

    @other.command(cls=ConfiguredCommand)
    @configurable
    def show(
        inputs: Annotated[list[str], typer.Argument()],
        *,
        key: Annotated[str, typer.Option("--key")],
        many: Annotated[list[Path] | None, typer.Option("--many", help="Some.")] = None,
        save: Annotated[str, typer.Option(help="What.")] = "depth",
        count: Annotated[int, typer.Option(min=1)] = 3,
        fast: Annotated[bool, typer.Option("--fast/--slow")] = True,
    ) -> None:
        typer.echo(f"{inputs} {key} {[each.name for each in many or []]} {save} {count} {fast}")

    def invoke(*arguments: str) -> tuple[int, str]:
        result = CliRunner(env={"COLUMNS": "300", "TERM": "dumb"}).invoke(other, list(arguments))
        return result.exit_code, " ".join(result.output.split())

    lines = ('many = ["a", "b"]', 'save = ["depth", "mesh.ply"]', "fast = false")
    file = str(written(tmp_path / "a.toml", *lines, "count = 4"))
    assert invoke("x", "y", "--key=k", "--config", file) == (0, "['x', 'y'] k ['a', 'b'] depth,mesh.ply 4 False")
    assert invoke("x", "--key=k", "--config", file, "--fast", "--many=c") == (0, "['x'] k ['c'] depth,mesh.ply 4 True")
    status, text = invoke("--config", file, "--dump-config", "--count=5")
    assert status == 0
    assert f'many = ["{tmp_path / "a"}", "{tmp_path / "b"}"]' in text
    assert 'save = "depth,mesh.ply"' in text
    assert "count = 5" in text
    assert "key" not in text
    assert invoke("--config", file)[0] == 2
    status, text = invoke("x", "--key=k", "--config", str(written(tmp_path / "b.toml", "count = 0")))
    assert status == 2
    assert f"{tmp_path / 'b.toml'}: count = 0: " in text
    for line in ("key = 'k'", "inputs = ['x']"):
        status, text = invoke("x", "--key=k", "--config", str(written(tmp_path / "c.toml", line)))
        assert status == 2
        assert "on the command line alone" in text
