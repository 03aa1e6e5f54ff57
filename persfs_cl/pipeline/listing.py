"""From what somebody names, files, folders, globs, lists and videos, to single photographs with names for results."""

from __future__ import annotations

import errno
import os
import stat
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from persfs_cl.errors import InputError
from persfs_cl.io import decode, video
from persfs_cl.io.files import FilePath, as_path, read_bytes
from persfs_cl.pipeline import tree
from persfs_cl.pipeline.guides import SUFFIXES
from persfs_cl.pipeline.naming import ancestors, result_names

STANDARD_INPUT = "-"
_LISTS = frozenset({".txt", ".lst"})
_IMAGES = decode.SUFFIXES


@dataclass(frozen=True, slots=True)
class Input:
    """A photograph that is to be solved, or a frame of a video.

    Attributes
    ----------
    path : Path
        The file.
    name : str
        The folder of its results, below the output, with "/" between its parts.
    frame : int or None
        Which frame of a video, from 0.
    """

    path: Path
    name: str
    frame: int | None = None


@dataclass(frozen=True)
class Listing:
    """What came of the paths that were given.

    Attributes
    ----------
    inputs : list of Input
        Sorted by name; each file is there once.
    problems : list of (str, InputError)
        What cannot be used, as it was given, and why.
    roots : tuple of Path
        Folders that names of inputs are relative to: those given, the fixed parts of globs, and those of lists.
    """

    inputs: list[Input]
    problems: list[tuple[str, InputError]]
    roots: tuple[Path, ...] = ()


def read_standard_input() -> bytes:
    """All of it."""
    return sys.stdin.buffer.read()


def list_inputs(
    given: Iterable[FilePath] | FilePath,
    *,
    output: Path | None = None,
    masks: Path | None = None,
    read_stdin: Callable[[], bytes] = read_standard_input,
    frames: str | None = None,
) -> Listing:
    """The photographs that paths stand for.

    A path is

    - an image file, whatever its suffix;
    - a folder: its images, and those of all folders in it, by their suffixes. What begins with a dot is left out, and
      so are the output and the folder of masks. Folders are entered through symbolic links too, each once;
    - a pattern with ``*``, ``?`` and ``[...]`` as in a shell, and ``**`` for any number of folders. A folder that fits
      stands for what is in it;
    - a list: a file `.txt` or `.lst` in UTF-8 with a path a line, relative to the folder of the list. Blank lines, and
      those that begin with ``#``, are left out. ``-`` is a list on standard input, relative to the working directory;
      there as in files, a zero byte ends each path if there are any. A list may name whatever can be given but lists;
    - a video: its frames. Videos in folders are left out.

    Results are named by the path below the folder that was given, or below the fixed part of a pattern. A file that is
    named itself keeps its path, if that is relative and does not go up, or else has its name alone. See
    :func:`persfs_cl.pipeline.naming.result_names` for those that would have the same.

    Parameters
    ----------
    given : iterable of path
    output : Path, optional
        The folder of the results.
    masks : Path, optional
        The folder of masks. Where images and masks share a folder, `a.jpg.png` beside `a.jpg` is a mask.
    read_stdin : callable
        Gives what is on standard input.
    frames : str, optional
        Which frames of videos: START:STOP:STEP as Python slices, each part as one likes. All by default.

    Returns
    -------
    Listing
        Where nothing can be used, its `problems` say why.

    Raises
    ------
    InputError
        When `frames` is no such text, or there are photographs and no video that it could be about, or a path is none.
    """
    paths: Iterable[FilePath] = [given] if isinstance(given, (str, os.PathLike)) else given
    lister = _Lister(output, masks, read_stdin, video.frame_slice(frames))
    for path in paths:
        # Not through a Path where it is a text, which would lose what is odd about it.
        lister.add(path if isinstance(path, str) and path else str(as_path(path)))
    if frames is not None and lister.found and not lister.videos:
        raise InputError.about(
            "frames",
            frames,
            "chooses frames of videos, and none is given: name videos by their paths or a pattern, for those in "
            "folders are left out, or leave it out.",
        )
    return lister.listing()


def mask_for(entry: Input, folder: Path) -> Path:
    """The mask that belongs to an input, by COLMAP's naming: that of `abc/012.jpg` is `abc/012.jpg.png`.

    As for any mask, black is what is left out.

    Parameters
    ----------
    entry : Input
        A frame of a video may have a mask of its own, `clip.mp4/000012.png`, or share that of the video,
        `clip.mp4.png`.
    folder : Path
        Where the masks are, in folders as the names of inputs have them.

    Raises
    ------
    InputError
        When there is none: a photograph is not solved with what its mask was to leave out.
    """
    own = folder / f"{entry.name}.png"
    if own.is_file():
        return own
    if entry.frame is not None and (shared := folder / f"{entry.name.rpartition('/')[0]}.png").is_file():
        return shared
    raise InputError(
        f"{entry.path} has no mask: {own} does not exist. Make it, all white if everything is to be solved; masks are "
        "named after the photos below the folder that is given, so give the folder, not its files."
    )


def guide_for(entry: Input, folder: Path) -> Path:
    """The guide that belongs to an input: that of `abc/012.jpg` is `abc/012.jpg.npy`, or has another of the suffixes.

    Raises
    ------
    InputError
        When there is none.
    """
    for suffix in SUFFIXES:
        if (own := folder / f"{entry.name}{suffix}").is_file():
            return own
    raise InputError(
        f"{entry.path} has no guide: none of {folder / entry.name}{{{','.join(SUFFIXES)}}} exists. Guides are named "
        "after the photos below the folder that is given; leave out photos that have none."
    )


_STREAM = "standard input"
"""What a list is called that comes from there."""


class _Found(NamedTuple):
    """An input before it has its final name; `place` is its absolute path, with frame, by which it is told apart."""

    place: str
    path: str
    name: str
    frame: int | None = None


class _Lister:
    def __init__(self, output: Path | None, masks: Path | None, read_stdin: Callable[[], bytes], frames: slice) -> None:
        self.output = None if output is None else os.path.realpath(output)
        self.masks = None if masks is None else os.path.realpath(masks)
        self.read_stdin, self.frames = read_stdin, frames
        self.found: dict[str, _Found] = {}
        self.problems: list[tuple[str, InputError]] = []
        self.videos = 0
        self.roots: dict[str, None] = {}
        self.places: dict[str, str] = {}

    def listing(self) -> Listing:
        """With final names."""
        # In an order that does not depend on the file system's.
        entries = sorted(self.found.values(), key=lambda entry: (entry.name, entry.place))
        names = result_names([entry.name for entry in entries], [entry.place for entry in entries])
        over = self._inputs_in_output()
        folders_over = ancestors(over)
        inputs: dict[str, Input] = {}
        for name, entry in sorted(zip(names, entries, strict=True)):
            path = Path(entry.path)
            if name in inputs:
                why = f"{path} would have the results of {inputs[name].path}, {name}: rename one of them."
                self.problems.append((entry.path, InputError(why)))
            elif over and (name in over or name in folders_over or not over.isdisjoint(ancestors([name]))):
                why = f"The results of {path} would lie where photos are, in {self.output}: choose another output."
                self.problems.append((entry.path, InputError(why)))
            else:
                inputs[name] = Input(path, name, entry.frame)
        return Listing(list(inputs.values()), self.problems, tuple(map(Path, self.roots)))

    def add(self, text: str, base: str = "", within: str = "") -> None:
        """Take what is given, relative to a folder, on a line of a list."""
        if text == STANDARD_INPUT and not within:
            self._list(text, "")
            return
        path = os.path.join(base, text)
        shown = f"{within}: {text}" if within else text
        try:
            kind = os.stat(path).st_mode
        except (OSError, ValueError) as error:
            missing = isinstance(error, OSError) and error.errno in (errno.ENOENT, errno.ENOTDIR)
            if missing and tree.has_pattern(text):
                self._pattern(path, shown)
            elif missing:
                of_file = within and not within.startswith(_STREAM)
                start = " Paths in a list start at its folder." if of_file else ""
                self._refuse(shown, f"{path} does not exist: check the spelling and the folder.{start}")
            else:
                self._refuse(shown, f"{path!r} cannot be read ({error}): check the path and its permissions.")
            return
        suffix = _suffix(text)
        if stat.S_ISDIR(kind):
            self._folder(path, shown)
        elif suffix in _LISTS and not within:
            self._list(path, os.path.dirname(path))
        elif suffix in _LISTS:
            self._refuse(shown, f"{path} is a list in a list: give it by itself.")
        else:
            self._file(_Found(self._place(path), path, _name(text)), shown, suffix)

    def _list(self, path: str, base: str) -> None:
        within = _STREAM if path == STANDARD_INPUT else path
        try:
            data = self.read_stdin() if path == STANDARD_INPUT else read_bytes(path)
        except InputError as error:
            self.problems.append((path, error))
            return
        self.roots[base or "."] = None
        named, troubles = 0, len(self.problems)
        ended = b"\0" in data
        if ended and (data.startswith(b"\0") or b"\0\0" in data):
            # No program that lists files writes an empty name. Of a photo every few bytes would be taken for a path.
            self._refuse(path, f"{within} holds no text: give photos by themselves, and paths of photos in a list.")
            return
        for number, line in enumerate(data.removeprefix(b"\xef\xbb\xbf").split(b"\0" if ended else b"\n"), 1):
            try:
                text = os.fsdecode(line) if ended else line.decode().strip()
            except UnicodeDecodeError as error:
                self._refuse(path, f"{within}, line {number}, is no UTF-8 ({error}): save the list as UTF-8.")
                continue
            if text and (ended or not text.startswith("#")):
                named += 1
                self.add(text, base, f"{within}, line {number}")
        if not named and troubles == len(self.problems):
            self._refuse(path, f"{within} names no photo: write a path a line.")

    def _file(self, entry: _Found, shown: str, suffix: str) -> None:
        if suffix not in video.SUFFIXES:
            self.found.setdefault(entry.place, entry)
            return
        self.videos += 1
        try:
            count = video.count_frames(entry.path)
        except InputError as error:
            self.problems.append((shown, error))
            return
        chosen = range(count)[self.frames]
        if not chosen:
            self._refuse(shown, f"{entry.path} has {count} frames, and none of those asked for: choose others.")
        for frame in chosen:
            number = f"{frame:06d}"
            place = f"{entry.place}{os.sep}{number}"
            self.found.setdefault(place, _Found(place, entry.path, f"{entry.name}/{number}", frame))

    def _folder(self, path: str, shown: str) -> None:
        if os.path.realpath(path) == self.output:
            self._refuse(shown, f"{path} is the output itself: choose another output than the folder of the photos.")
            return
        self._take(path, shown, None)

    def _pattern(self, path: str, shown: str) -> None:
        top, pattern = tree.split_pattern(path)
        if not os.path.isdir(top):
            self._refuse(shown, f"{path} fits nothing: {top} is no folder. Check the spelling.")
            return
        self._take(top, shown, pattern)

    def _take(self, top: str, shown: str, pattern: list[str] | None) -> None:
        """The images below a folder, or those that fit a pattern, or lie in a folder that does."""

        def unreadable(path: str, error: OSError) -> None:
            self._refuse(path.rstrip(os.sep), f"{path} cannot be read ({error.strerror}): change its permissions.")

        def enter(below: str) -> bool:
            return pattern is None or tree.may_lead(pattern, below.split("/")[:-1])

        self.roots[top] = None
        taken, troubles = 0, len(self.problems)
        leave_out = {folder for folder in (self.output, self.masks) if folder is not None}
        for folder in tree.walk(top, leave_out=leave_out, unreadable=unreadable, enter=enter):
            parts = folder.below.split("/")[:-1]
            whole = pattern is None or any(tree.fits(pattern, parts[:depth]) for depth in range(1, len(parts) + 1))
            for name in self._without_masks(folder):
                suffix = _suffix(name)
                if not (suffix in _IMAGES or (not whole and suffix in video.SUFFIXES)):
                    continue
                if whole or (pattern is not None and tree.fits(pattern, [*parts, name])):
                    taken += 1
                    found = _Found(folder.place + name, folder.path + name, folder.below + name)
                    self._file(found, shown, suffix)
        if not taken and troubles == len(self.problems):
            where = f"{top} holds" if pattern is None else f"{shown} fits"
            self._refuse(
                shown, f"{where} no image by its suffix (PNG, JPEG, TIFF, camera raw, WebP and others): check the path."
            )

    def _without_masks(self, folder: tree.Folder) -> list[str]:
        if self.masks is None or not folder.place.startswith(os.path.join(self.masks, "")):
            return folder.files
        masks = {f"{name}.png" for name in folder.files if _suffix(name) in _IMAGES}
        return [name for name in folder.files if name not in masks]

    def _inputs_in_output(self) -> set[str]:
        """Files of inputs that lie in the output, relative to it, as names of results are written."""
        if self.output is None:
            return set()
        top = os.path.join(self.output, "")
        files = (entry.place if entry.frame is None else os.path.dirname(entry.place) for entry in self.found.values())
        return {file[len(top) :].replace(os.sep, "/") for file in files if file.startswith(top)}

    def _place(self, path: str) -> str:
        """An absolute path without links to folders; a link to a file stays what it is called."""
        folder, name = os.path.split(path)
        place = self.places.get(folder)
        if place is None:
            place = self.places[folder] = os.path.join(os.path.realpath(folder or "."), "")
        return place + name

    def _refuse(self, shown: str, why: str) -> None:
        self.problems.append((shown, InputError(why)))


def _name(text: str) -> str:
    """The result's name for a file that is given by itself; not by a Path, which takes longer than all else here."""
    drive, rest = os.path.splitdrive(text)
    parts = [part for part in rest.replace(os.sep, "/").split("/") if part not in ("", ".")]
    return parts[-1] if drive or os.path.isabs(text) or ".." in parts else "/".join(parts)


def _suffix(name: str) -> str:
    """In small letters, with its dot."""
    return os.path.splitext(name)[1].lower()
