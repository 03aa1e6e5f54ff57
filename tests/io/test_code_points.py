"""Code points of HEIC and AVIF: the light that was written, by the curves of HDR photos and wide primaries."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import pillow_heif
import pytest
from numpy.typing import NDArray

from persfs_cl.colour import decode_hlg, decode_pq, encode_srgb
from persfs_cl.io.code_points import CodePoints, code_points_in
from persfs_cl.io.photos import read_photo

BITS, SHAPE = 12, (16, 24)
BT709 = (0.64, 0.33), (0.30, 0.60), (0.15, 0.06)
BT2020 = (0.708, 0.292), (0.170, 0.797), (0.131, 0.046)
P3 = (0.680, 0.320), (0.265, 0.690), (0.150, 0.060)
WHITE = (0.3127, 0.3290)
Light = NDArray[np.float64]


def encode_pq(light: Light) -> Light:
    """BT.2100, table 4."""
    power = light ** (2610 / 16384)
    return np.asarray(((3424 / 4096 + 2413 / 128 * power) / (1 + 2392 / 128 * power)) ** (2523 / 32))


def encode_hlg(light: Light) -> Light:
    """BT.2100, table 5."""
    bright = 0.17883277 * np.log(np.maximum(12 * light - 0.28466892, 1e-9)) + 0.55991073
    return np.asarray(np.where(light <= 1 / 12, np.sqrt(3 * light), bright))


def xyz_by_rgb(primaries: tuple[tuple[float, float], ...]) -> Light:
    columns = np.stack([(x / y, 1.0, (1 - x - y) / y) for x, y in primaries], axis=1)
    white = np.array([WHITE[0] / WHITE[1], 1.0, (1 - WHITE[0] - WHITE[1]) / WHITE[1]])
    return np.asarray(columns * np.linalg.solve(columns, white))


CODES: dict[str, tuple[int, int, tuple[Any, ...], Callable[[Light], Light], float, str]] = {
    "PQ": (9, 16, BT2020, encode_pq, 203 / 10_000, "pq"),
    "HLG": (9, 18, BT2020, encode_hlg, 0.265, "hlg"),
    "Display P3": (12, 13, P3, lambda light: np.asarray(encode_srgb(light)), 1.0, "srgb"),
    "linear": (1, 8, BT709, lambda light: light, 1.0, "linear"),
}


def some_light() -> Light:
    """Linear sRGB from black to paper white."""
    return np.random.default_rng(5).uniform(0.05, 0.95, (*SHAPE, 3))


def heic(samples: NDArray[np.uint16], primaries: int, transfer: int) -> bytes:
    pillow_heif.options.SAVE_HDR_TO_12_BIT = True
    data = (samples << (16 - BITS)).tobytes()
    picture, written = pillow_heif.from_bytes("RGB;16", SHAPE[::-1], data), io.BytesIO()
    picture.save(
        written,
        quality=-1,
        chroma=444,
        matrix_coefficients=0,
        color_primaries=primaries,
        transfer_characteristics=transfer,
    )
    return written.getvalue()


def avif(samples: NDArray[np.uint16], primaries: int, transfer: int) -> bytes:
    """With the codes put in the place of others."""
    data = bytes(imagecodecs.avif_encode(samples, level=100, speed=8, bitspersample=BITS))
    place = data.index(b"colrnclx") + 8
    return data[:place] + struct.pack(">HH", primaries, transfer) + data[place + 4 :]


@pytest.mark.parametrize("write", [heic, avif])
@pytest.mark.parametrize("name", CODES)
def test_codes_are_read_to_the_light_that_was_written(tmp_path: Path, name: str, write: Any) -> None:
    primaries, transfer, corners, encode, white, curve = CODES[name]
    light = some_light()
    there = white * (light @ np.linalg.solve(xyz_by_rgb(corners), xyz_by_rgb(BT709)).T)
    path = tmp_path / f"a.{write.__name__}"
    path.write_bytes(write(np.rint(encode(there) * (2**BITS - 1)).astype(np.uint16), primaries, transfer))
    photo = read_photo(path)
    assert photo.encoding == curve
    np.testing.assert_allclose(photo.image, white * light @ (0.2126, 0.7152, 0.0722), rtol=4e-3)
    green = read_photo(path, channel="green").image
    np.testing.assert_allclose(green, there[..., 1], rtol=4e-3)
    # As people see it: paper white is white.
    np.testing.assert_allclose(photo.colour.astype(int), np.rint(255 * encode_srgb(light)), atol=2)
    assert (name.rsplit(maxsplit=1)[-1] in photo.profile) or name in photo.profile
    # Whoever says what the numbers are is believed.
    said = read_photo(path, encoding="linear")
    assert (said.encoding, said.profile) == ("linear", "")


def test_a_curve_that_is_not_known_is_warned_of(tmp_path: Path) -> None:
    (tmp_path / "a.avif").write_bytes(avif(np.full((*SHAPE, 3), 2000, np.uint16), 1, 11))
    with pytest.warns(UserWarning, match=r"a\.avif says that its numbers follow the curve 11 of ITU-T H\.273"):
        assert read_photo(tmp_path / "a.avif").encoding == "srgb"


def test_primaries_that_are_not_known_are_warned_of(tmp_path: Path) -> None:
    (tmp_path / "a.avif").write_bytes(avif(np.full((*SHAPE, 3), 2000, np.uint16), 11, 13))
    with pytest.warns(UserWarning, match=r"a\.avif says that its colours have the primaries 11 of ITU-T H\.273"):
        assert read_photo(tmp_path / "a.avif").encoding == "srgb"


def test_codes_are_found_in_their_box_alone() -> None:
    assert code_points_in(b"colrnclx\0\x09\0\x10") == CodePoints(9, 16)
    for data in (b"", b"colrnclx\0", b"colrprof\0\x09\0\x10"):
        assert code_points_in(data) is None


def test_the_curves_of_hdr_at_the_values_of_their_standards() -> None:
    # BT.2408: 100 cd/m² and paper white.
    np.testing.assert_allclose(decode_pq([0.0, 0.5081, 0.5807, 1.0]), [0.0, 0.01, 0.0203, 1.0], rtol=2e-3, atol=1e-12)
    np.testing.assert_allclose(decode_hlg([0.0, 0.5, 0.75, 1.0]), [0.0, 1 / 12, 0.265, 1.0], rtol=1e-3)
