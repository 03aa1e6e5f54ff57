"""What gets installed is what the checkout holds: nothing missing, nothing extra, nothing done at import."""

from __future__ import annotations

import ast
import email
import os
import pkgutil
import shutil
import subprocess
import sys
import tarfile
import zipfile
from email.message import Message
from pathlib import Path

import pytest

import persfs_cl

ROOT = Path(__file__).resolve().parent.parent


def run(*command: str | Path, cwd: Path, **environment: str) -> str:
    """Standard output of a command; a failure shows everything that it said."""
    done = subprocess.run(
        command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command} failed:\n{done.stdout}\n{done.stderr}"
    return done.stdout


def source_files(folder: str) -> set[str]:
    """Files of the project in a folder, as git sees them, or as they lie where there is no git."""
    if (ROOT / ".git").exists():
        command = ("git", "ls-files", "--cached", "--others", "--exclude-standard", "--", folder)
        return set(run(*command, cwd=ROOT).splitlines())
    found = (path for path in (ROOT / folder).rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(ROOT).as_posix() for path in found}


def kernel_files() -> set[str]:
    return {name for name in source_files("kernels") if name.endswith(".cl")}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the sdist of the checkout, and the wheel built from that sdist."""
    directory = tmp_path_factory.mktemp("built")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", directory, ROOT, cwd=directory)
    return directory


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    (path,) = built.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def wheel_files(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


@pytest.fixture(scope="module")
def metadata(wheel: Path) -> Message:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        return email.message_from_string(archive.read(name).decode())


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory outside the checkout with the wheel installed into it."""
    target = tmp_path_factory.mktemp("installed")
    run(
        *(sys.executable, "-m", "pip", "install", "--disable-pip-version-check", "--no-deps", "--no-index"),
        *("--target", target, wheel),
        cwd=target,
    )
    return target


def test_wheel_holds_every_kernel(wheel_files: set[str]) -> None:
    kernels = kernel_files()
    assert kernels
    assert {name for name in wheel_files if name.endswith(".cl")} == {f"persfs_cl/{name}" for name in kernels}


def test_wheel_holds_the_package_and_nothing_else(wheel_files: set[str]) -> None:
    sources = source_files("persfs_cl")
    assert {"persfs_cl/py.typed", "persfs_cl/data/coin.png", "persfs_cl/data/coin_mask.png"} <= sources
    others = {name for name in wheel_files if not name.startswith("persfs_cl/kernels/")}
    assert {name for name in others if ".dist-info/" not in name} == sources


def test_sdist_holds_what_a_packager_needs(built: Path) -> None:
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        files = {name.partition("/")[2] for name in archive.getnames()}
    needed = {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff"}
    needed |= {"Makefile", "mkdocs.yml"}
    for folder in ("persfs_cl", "kernels", "tests", "docs"):
        needed |= source_files(folder)
    assert needed <= files


def test_metadata(metadata: Message, wheel_files: set[str]) -> None:
    assert metadata["Name"] == "persfs-cl"
    assert metadata["License-Expression"] == "MIT AND CC-BY-4.0"
    assert metadata["Requires-Python"] == ">=3.10"
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in wheel_files)
    assert str(metadata.get_payload()).strip() == (ROOT / "README.md").read_text(encoding="utf-8").strip()


def test_dependencies_have_no_upper_bound(metadata: Message) -> None:
    requirements = [text.partition(";")[0] for text in metadata.get_all("Requires-Dist", [])]
    assert any(text.startswith("pyopencl") for text in requirements)
    assert not [text for text in requirements if any(sign in text for sign in ("<", "==", "~="))]


def test_installed_wheel_finds_its_own_kernels_and_version(installed: Path, metadata: Message) -> None:
    script = """
import persfs_cl
from persfs_cl._cl.program import kernel_names, kernel_source
assert all(kernel_source(name).strip() for name in kernel_names())
print(persfs_cl.__file__, persfs_cl.__version__, *kernel_names(), sep="\\n")
"""
    output = run(sys.executable, "-c", script, cwd=installed, PYTHONPATH=str(installed))
    file, version, *names = output.splitlines()
    assert Path(file).resolve().is_relative_to(installed.resolve())
    assert version == metadata["Version"]
    assert sorted(names) == sorted(Path(name).stem for name in kernel_files())


def test_installed_command(installed: Path) -> None:
    output = run(sys.executable, "-m", "persfs_cl", "--help", cwd=installed, PYTHONPATH=str(installed))
    assert "reconstruct" in output
    assert list((installed / "bin").glob("persfs-cl*"))


def test_only_one_room_imports_pyopencl() -> None:
    importers = set()
    for path in (ROOT / "persfs_cl").rglob("*.py"):
        if "pyopencl" not in (text := path.read_text(encoding="utf-8")):
            continue
        for node in ast.walk(ast.parse(text)):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if any(name.partition(".")[0] == "pyopencl" for name in names):
                importers.add(path.relative_to(ROOT / "persfs_cl").parts[0])
    assert importers == {"_cl"}


def test_import_does_no_work(installed: Path, tmp_path: Path) -> None:
    script = """
import sys
import pyopencl

def refuse(*arguments, **keywords):
    raise AssertionError("OpenCL was used at import")

for name in ("get_platforms", "create_some_context", "Context", "CommandQueue", "Program"):
    setattr(pyopencl, name, refuse)
import persfs_cl
slow = {"PIL", "imagecodecs", "imageio", "matplotlib", "tifffile", "trimesh"}
print(*sorted(slow & set(sys.modules)))
"""
    # In an empty directory: what an import leaves behind would show.
    assert run(sys.executable, "-c", script, cwd=tmp_path, PYTHONPATH=str(installed)).split() == []
    assert list(tmp_path.iterdir()) == []


def test_public_names_are_imported_when_asked_for() -> None:
    script = """
import sys
import persfs_cl as ps
import persfs_cl.cli
print(*{"numpy", "pyopencl", "typer"} & sys.modules.keys(), "early")
listed = dir(ps)
assert {*ps.__all__, "__version__"} <= {*listed}
import persfs_cl.scenes.analytic
assert ps.scenes.analytic.vase is ps.vase
from persfs_cl import *
assert reconstruct is ps.reconstruct
assert all(name in globals() for name in ps.__all__)
assert not hasattr(ps, "nonsense")
"""
    assert run(sys.executable, "-c", script, cwd=ROOT).split() == ["early"]


def test_what_types_are_checked_with_is_what_is_imported() -> None:
    (branch,) = (
        node for node in ast.parse((ROOT / "persfs_cl" / "__init__.py").read_text()).body if isinstance(node, ast.If)
    )
    checked = {
        str(node.module): tuple(name.name for name in node.names)
        for node in branch.body
        if isinstance(node, ast.ImportFrom)
    }
    homes: dict[str, tuple[str, ...]] = vars(persfs_cl)["_HOMES"]
    assert {f"persfs_cl.{home}": names for home, names in homes.items()} == checked
    names = [name for names in homes.values() for name in names]
    assert sorted(names) == sorted(persfs_cl.__all__)
    modules = {module.name for module in pkgutil.iter_modules(persfs_cl.__path__)}
    assert not modules.intersection(names), "the import of a module would put it in the place of what is public"


def test_what_cites_it_says_the_same_version(metadata: Message) -> None:
    lines = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert f"version: {metadata['Version']}" in lines


@pytest.mark.thorough
def test_the_image_of_a_container_is_built(tmp_path: Path) -> None:
    if shutil.which("docker") is None:
        pytest.skip("docker is not installed")
    if subprocess.run(["docker", "info"], capture_output=True, check=False).returncode:
        pytest.skip("docker does not run here")
    run("docker", "build", "--file", ROOT / ".ci" / "Dockerfile", "--tag", "persfs-cl-test", ROOT, cwd=tmp_path)
    assert "persfs-cl" in run("docker", "run", "--rm", "persfs-cl-test", "--version", cwd=tmp_path)
