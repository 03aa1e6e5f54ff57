"""Files of every format that is read, made here: images, EXIF data, arrays and points."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import dataclass
from typing import Any

import imagecodecs
import numpy as np
import pillow_heif
import tifffile
from dng import write_dng
from numpy.random import Generator
from numpy.typing import NDArray
from PIL import Image

from fuzz.mutate import EDGES, EXIF_POINTER, PNG_SIGNATURE, jpeg_segment, png_chunk

_STRUCT = {1: "B", 2: "s", 3: "H", 4: "I", 5: "II", 6: "b", 7: "s", 8: "h", 9: "i", 10: "ii", 11: "f", 12: "d", 13: "I"}
"""Format of each type of TIFF."""


@dataclass(frozen=True)
class File:
    """What a file holds, and the suffix and shape that go with it."""

    suffix: str
    data: bytes
    shape: tuple[int, int]


def image(random: Generator) -> File:
    """A good image of some format."""
    return (_png, _jpeg, _tiff, _tiff, _with_profile, _by_pillow, _deep, _heic, _dng)[random.integers(9)](random)


def _shape(random: Generator) -> tuple[int, int]:
    height, width = random.integers(1, 25, 2)
    return int(height), int(width)


def _samples(random: Generator, shape: tuple[int, int], channels: int, dtype: str) -> NDArray[Any]:
    size = shape if channels == 1 else (*shape, channels)
    kind = np.dtype(dtype)
    if kind.kind == "f":
        return np.asarray(random.uniform(0, 2, size).astype(kind))
    if kind.kind == "c":
        return np.ones(size, kind)
    return np.asarray(random.integers(0, min(np.iinfo(kind).max, 2**31), size, endpoint=True).astype(kind))


def _png(random: Generator) -> File:
    shape = _shape(random)
    if random.uniform() < 0.4:
        samples = _samples(random, shape, int(random.integers(1, 5)), ("uint8", "uint16")[random.integers(2)])
        return File(".png", bytes(imagecodecs.png_encode(np.ascontiguousarray(samples))), shape)
    mode = ("1", "L", "LA", "P", "RGB", "RGBA", "I;16")[random.integers(7)]
    grey, coloured = _samples(random, shape, 1, "uint16"), _samples(random, shape, 3, "uint8")
    picture = Image.fromarray(grey) if mode == "I;16" else Image.fromarray(coloured).convert(mode)
    options: dict[str, Any] = {}
    if random.uniform() < 0.3 and mode in ("L", "P", "RGB"):
        options["transparency"] = (10, 20, 30) if mode == "RGB" else bytes([0, 128, 255]) if mode == "P" else 10
    if random.uniform() < 0.1 and mode == "RGB":
        options |= {"save_all": True, "append_images": [picture.rotate(180)]}
    written = io.BytesIO()
    picture.save(written, "PNG", **options)
    return File(".png", written.getvalue(), shape)


def _jpeg(random: Generator) -> File:
    shape = _shape(random)
    mode = ("L", "RGB", "RGB", "CMYK")[random.integers(4)]
    picture = Image.fromarray(_samples(random, shape, 3, "uint8")).convert(mode)
    written = io.BytesIO()
    picture.save(written, "JPEG", progressive=bool(random.integers(2)))
    return File(".jpg", with_exif(".jpg", written.getvalue(), exif(random, shape, strange=0.0)), shape)


def _tiff(random: Generator) -> File:
    shape = _shape(random)
    common = ["uint8", "uint16", "float32"]
    dtype = str(random.choice([*common, *common, "float16", "float64", "int16", "uint32", "int8", "complex64"]))
    channels = int(random.choice([1, 1, 2, 3, 4]))
    samples = _samples(random, shape, channels, dtype)
    options: dict[str, Any] = {"metadata": None}
    options["photometric"] = "rgb" if channels > 2 else "minisblack"
    if channels in (2, 4):
        options["extrasamples"] = [str(random.choice(["unassalpha", "assocalpha", "unspecified"]))]
    if channels > 1:
        options["planarconfig"] = "contig"
        if random.uniform() < 0.2:
            options["planarconfig"] = "separate"
            samples = np.moveaxis(samples, -1, 0)
    elif random.uniform() < 0.2:
        options["photometric"] = "miniswhite"
    elif random.uniform() < 0.2 and dtype == "uint8":
        options |= {"photometric": "palette", "colormap": random.integers(0, 2**16, (3, 256)).astype("uint16")}
    if random.uniform() < 0.5:
        options["compression"] = str(random.choice(["deflate", "lzw", "packbits", "zstd"]))
        if options["compression"] != "packbits" and dtype in common and random.uniform() < 0.5:
            options["predictor"] = True
        elif dtype == "uint8" and channels == 3 and options["planarconfig"] == "contig" and random.uniform() < 0.3:
            options["compression"] = "jpeg"
    if random.uniform() < 0.3:
        options["tile"] = (16, 16)
    elif random.uniform() < 0.3:
        options["rowsperstrip"] = int(random.integers(1, shape[0] + 1))
    if random.uniform() < 0.3:
        options["extratags"] = [(274, "H", 1, int(random.integers(0, 10)), True)]
    written = io.BytesIO()
    order: Any = random.choice(["<", ">"])
    with tifffile.TiffWriter(written, bigtiff=bool(random.uniform() < 0.2), byteorder=order) as writer:
        for _ in range(2 if random.uniform() < 0.05 else 1):
            writer.write(samples, **options)
    return File(str(random.choice([".tif", ".tiff"])), written.getvalue(), shape)


def _by_pillow(random: Generator) -> File:
    shape = _shape(random)
    suffix, form = ((".webp", "WEBP"), (".bmp", "BMP"), (".jp2", "JPEG2000"))[random.integers(3)]
    mode = ("L", "RGB", "RGBA")[random.integers(3)]
    picture = Image.fromarray(_samples(random, shape, 3, "uint8")).convert(mode)
    options: dict[str, Any] = {}
    if random.uniform() < 0.4 and suffix == ".webp":
        options["exif"] = exif(random, shape, strange=0.1)
    if random.uniform() < 0.4 and suffix == ".webp":
        options["icc_profile"] = _profile(random)
    if random.uniform() < 0.1 and suffix == ".webp":
        options |= {"save_all": True, "append_images": [picture.rotate(180)]}
    written = io.BytesIO()
    picture.save(written, form, **options)
    return File(suffix, written.getvalue(), shape)


def _deep(random: Generator) -> File:
    """Of 8 to 16 bits."""
    shape = _shape(random)
    bits, channels = int(random.choice([8, 10, 12, 16])), int(random.choice([1, 3]))
    samples = (_samples(random, shape, channels, "uint16") >> (16 - bits)).astype("uint8" if bits == 8 else "uint16")
    if bits < 16 and channels == 3 and random.integers(2):
        return File(".avif", bytes(imagecodecs.avif_encode(samples, level=100, speed=10, bitspersample=bits)), shape)
    return File(".jp2", bytes(imagecodecs.jpeg2k_encode(samples, level=0, bitspersample=bits)), shape)


def _heic(random: Generator) -> File:
    shape = int(random.integers(16, 33)), int(random.integers(16, 33))
    picture = pillow_heif.from_pillow(Image.fromarray(_samples(random, shape, 3, "uint8")))
    written = io.BytesIO()
    picture.save(written, quality=90, exif=b"Exif\0\0" + exif(random, shape, strange=0.1))
    return File(".heic", written.getvalue(), shape)


def _dng(random: Generator) -> File:
    shape = int(random.integers(8, 20)) * 2, int(random.integers(8, 20)) * 2
    colours = (*shape, 3) if random.integers(2) else shape
    samples = random.integers(0, 2**14, colours).astype(np.uint16)
    written = io.BytesIO()
    compression = "jpegxl" if len(colours) == 3 and random.integers(2) else None
    write_dng(written, samples, orientation=int(random.integers(0, 10)), compression=compression)
    return File(".dng", written.getvalue(), shape)


def _with_profile(random: Generator) -> File:
    shape = _shape(random)
    samples = _samples(random, shape, 3, ("uint8", "uint16", "float32")[random.integers(3)])
    written = io.BytesIO()
    tifffile.imwrite(written, samples, photometric="rgb", iccprofile=_profile(random))
    return File(".tif", written.getvalue(), shape)


def _profile(random: Generator) -> bytes:
    made = bytes(imagecodecs.cms_profile("srgb") if random.integers(2) else imagecodecs.cms_profile("gray", gamma=2.2))
    if random.integers(2):
        place = int(random.integers(len(made)))
        made = made[:place] + random.bytes(1) + made[place + 1 :]
    return made


def photo_with_exif(random: Generator) -> File:
    """A photo that tells of its lens, in words that may be strange."""
    shape = int(random.integers(1, 25)), int(random.integers(1, 25))
    suffix = (".png", ".jpg", ".tif")[random.integers(3)]
    if suffix == ".tif":
        return File(suffix, exif(random, shape, pixels=random.bytes(shape[0] * shape[1])), shape)
    written = io.BytesIO()
    Image.fromarray(_samples(random, shape, 1, "uint8")).save(written, "PNG" if suffix == ".png" else "JPEG")
    return File(suffix, with_exif(suffix, written.getvalue(), exif(random, shape)), shape)


def with_exif(suffix: str, data: bytes, content: bytes) -> bytes:
    """A PNG or JPEG file with EXIF data before all else."""
    if suffix == ".jpg":
        return data[:2] + jpeg_segment(0xE1, b"Exif\0\0" + content) + data[2:]
    header = len(PNG_SIGNATURE) + 25
    return data[:header] + png_chunk(b"eXIf", content) + data[header:]


def exif(random: Generator, shape: tuple[int, int], *, strange: float = 0.3, pixels: bytes | None = None) -> bytes:
    """EXIF data; with `pixels` a TIFF photo of 8 bits that has them. A share of the entries is `strange`."""
    order = "<" if random.integers(2) else ">"
    height, width = shape
    taken = shape if random.uniform() < 0.5 else (4 * height, 4 * width)
    main: dict[int, tuple[int, list[Any]]] = {
        271: (2, [b"Camera\0"]),
        274: (3, [int(random.integers(0, 10))]),
        305: (2, [b"Program\0"]),
    }
    if pixels is not None:
        main |= {256: (3, [width]), 257: (3, [height]), 258: (3, [8]), 259: (3, [1]), 262: (3, [1])}
        main |= {273: (4, [0]), 277: (3, [1]), 278: (3, [height]), 279: (4, [len(pixels)])}
    lens: dict[int, tuple[int, list[Any]]] = {
        37386: (5, [int(random.integers(2, 300)), 1]),
        40962: (4, [taken[1]]),
        40963: (4, [taken[0]]),
        41486: (5, [int(random.integers(1, 6000)), 1]),
        41487: (5, [int(random.integers(1, 6000)), 1]),
        41488: (3, [int(random.integers(1, 6))]),
        41989: (3, [int(random.integers(1, 200))]),
    }
    lens = {tag: entry for tag, entry in lens.items() if random.uniform() < 0.8}

    def changed(entries: dict[int, tuple[int, list[Any]]]) -> dict[int, tuple[int, list[Any]]]:
        return {tag: _strange(random) if random.uniform() < strange else entry for tag, entry in entries.items()}

    main, lens = (main if pixels is not None and random.uniform() < 0.8 else changed(main)), changed(lens)
    start = 8
    inner = start + 2 + 12 * (len(main) + 1) + 4
    beyond = inner + 2 + 12 * len(lens) + 4
    tail = pixels or b""
    if pixels is not None and 273 in main:
        main[273] = (4, [beyond])
    places = bytearray(tail)
    main[EXIF_POINTER] = (4, [inner])

    def directory(entries: dict[int, tuple[int, list[Any]]]) -> bytes:
        written = struct.pack(order + "H", len(entries))
        for tag, (type_, values) in sorted(entries.items()):
            if type_ in (2, 7):
                content = count = b"".join(values)
                number = len(count)
            else:
                content = struct.pack(order + _STRUCT.get(type_, "I")[0] * len(values), *values)
                number = len(values) // len(_STRUCT.get(type_, "I"))
            if len(content) > 4:
                offset = beyond + len(places)
                places.extend(content + b"\0" * (len(content) % 2))
                content = struct.pack(order + "I", offset)
            if random.uniform() < 0.1 * strange:
                number = int(EDGES[random.integers(13)])
            written += struct.pack(order + "HHI", tag, type_, number) + content.ljust(4, b"\0")
        return written + struct.pack(order + "I", 0)

    head = (b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, start)
    return head + directory(main) + directory(lens) + bytes(places)


def _strange(random: Generator) -> tuple[int, list[Any]]:
    """An entry of any type, with values at the edges of what the type can hold."""
    type_ = int(random.choice([*_STRUCT, 0, 77]))
    count = int(random.choice([0, 1, 1, 1, 2, 3]))
    if type_ in (2, 7):
        words = (b"", b"\0", b"35", b"50 mm\0", b"1/0", b"\xff\xfe", b"nan\0", b"inf\0", b"1e999")
        return type_, [words[random.integers(len(words))]]
    letter = _STRUCT.get(type_, "I")
    if letter in "fd":
        return type_, [float(random.choice([0.0, 35.0, -1.0, np.nan, np.inf, 1e-30, 3e38])) for _ in range(count)]
    bits = 8 * struct.calcsize("=" + letter[0])
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if letter.islower() else (0, 2**bits - 1)
    choices = [low, high, 0, 1, 2, 35, 50]
    return type_, [int(choices[random.integers(len(choices))]) for _ in range(count * len(letter))]


def array(random: Generator) -> File:
    """A NumPy file: mostly a map, of depth, light or mask."""
    shape = _shape(random)
    kinds = ["float64", "float32", "float16", "bool", "uint8", "int32", "uint64", "longdouble"]
    dtype = str(random.choice([*kinds, *kinds, "complex64", "datetime64[s]", "U3"]))
    size = shape if random.uniform() < 0.8 else ((), (0, 3), (4,), (2, 3, 4), (1, 1))[random.integers(5)]
    values = random.choice([0.0, 0.5, 1.0, 3.0], size)
    if np.dtype(dtype).kind == "f" and random.uniform() < 0.5:
        odd = random.choice([np.nan, np.nan, np.inf, -1.0, 1e308, 5e-324, 1e-30, -0.0])
        values = np.where(random.uniform(size=size) < 0.1, odd, values)
    with np.errstate(over="ignore", under="ignore"):
        stored = values.astype("int64").astype(dtype) if "datetime" in dtype else values.astype(dtype)
    written = io.BytesIO()
    np.save(written, np.asfortranarray(stored) if random.integers(2) else stored)
    return File(".npy", written.getvalue(), shape)


def points(random: Generator) -> File:
    """A CSV or JSON file of points on a depth map."""
    shape = _shape(random)
    count = int(random.integers(0, 8))
    rows = np.stack([random.uniform(-2, 26, count), random.uniform(-2, 26, count), random.uniform(0.1, 9, count)], 1)
    if random.integers(2):
        named: Any = [dict(zip(("column", "row", "depth"), map(float, row), strict=True)) for row in rows]
        text = json.dumps({"points": named} if random.integers(2) else named)
        return File(".json", text.encode(), shape)
    heading = (["column,row,depth"], ["name, depth, row, column"], [])[random.integers(3)]
    lead = "a," if heading and heading[0].startswith("name") else ""
    lines = [lead + ",".join(f"{value:.6g}" for value in row) for row in rows]
    end = str(random.choice(["\n", "\r\n"]))
    return File(".csv", (end.join([*heading, *lines]) + end).encode(), shape)
