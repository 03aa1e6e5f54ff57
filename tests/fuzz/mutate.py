"""Changes to files: blind ones to any bytes, and others that know the format and keep lengths and checksums right."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from numpy.random import Generator

EDGES = (0, 1, 2, 7, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1)
"""Numbers at which sizes, offsets and counts go wrong."""

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
EXIF_POINTER = 34665
_TAGS = (254, 256, 257, 258, 259, 262, 273, 274, 277, 278, 279, 284, 317, 320, 322, 323, 324, 325, 330, 338, 339)
_TYPE_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}


def mutated(random: Generator, data: bytes) -> bytes:
    """The file with some changes; one in ten has none."""
    if random.uniform() < 0.1:
        return data
    # Those that know the format come first: they cannot find their way in what the others leave.
    for _ in range(random.integers(0, 4)):
        data = with_format(random, data)
    for _ in range(random.choice([0, 0, 1, 1, 2, 5])):
        data = blindly(random, data)
    return data


def blindly(random: Generator, data: bytes) -> bytes:
    """One change that knows nothing of the format."""
    if not data:
        return random.bytes(4)
    begin, end = sorted(int(place) for place in random.integers(0, len(data) + 1, 2))
    end = min(end, begin + 200)
    piece = data[begin:end]
    place = int(random.integers(0, len(data)))

    def edge() -> bytes:
        size = 1 << int(random.integers(4))
        number = EDGES[random.integers(len(EDGES))] % (1 << 8 * size)
        return number.to_bytes(size, "little" if random.integers(2) else "big")

    changes: list[Callable[[], bytes]] = [
        lambda: data[:place] + bytes([data[place] ^ (1 << int(random.integers(8)))]) + data[place + 1 :],
        lambda: data[:place] + random.bytes(1) + data[place + 1 :],
        lambda: data[:place],
        lambda: data[:place] + random.bytes(int(random.integers(1, 20))) + data[place:],
        lambda: data[:end] + piece + data[end:],
        lambda: data[:begin] + data[end:],
        lambda: data[:begin] + bytes(len(piece)) + data[end:],
        lambda: data[:place] + piece + data[place + len(piece) :],
        lambda: data[:place] + (number := edge()) + data[place + len(number) :],
    ]
    return changes[int(random.integers(len(changes)))]()


def with_format(random: Generator, data: bytes) -> bytes:
    """One change that knows the format, where it is one of those that have pieces; else a blind one."""
    try:
        if data.startswith(PNG_SIGNATURE):
            return _png(random, data)
        if data.startswith(b"\xff\xd8"):
            return _jpeg(random, data)
        if data[:2] in (b"II", b"MM"):
            return tiff(random, data)
        if data.startswith(b"\x93NUMPY"):
            return _npy(random, data)
    except (struct.error, zlib.error, IndexError, OverflowError, ValueError):
        pass  # what earlier changes left is no such file any more
    return blindly(random, data)


def png_chunk(name: bytes, content: bytes) -> bytes:
    """A chunk with its length and checksum."""
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def png_chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    """Names and contents."""
    chunks, place = [], len(PNG_SIGNATURE)
    while place < len(data):
        (length,) = struct.unpack_from(">I", data, place)
        chunks.append((data[place + 4 : place + 8], data[place + 8 : place + 8 + length]))
        place += 12 + length
    return chunks


def _png(random: Generator, data: bytes) -> bytes:
    chunks = png_chunks(data)
    place, other = (int(number) for number in random.integers(0, len(chunks), 2))
    name, content = chunks[place]
    match random.integers(7):
        case 0:
            chunks[place], chunks[other] = chunks[other], chunks[place]
        case 1:
            chunks.insert(other, chunks[place])
        case 2:
            del chunks[place]
        case 3:
            names = (b"tRNS", b"PLTE", b"gAMA", b"iCCP", b"eXIf", b"acTL", b"fcTL", b"IDAT", b"zTXt", b"sBIT", b"pHYs")
            chunks.insert(other, (names[random.integers(len(names))], random.bytes(int(random.integers(0, 40)))))
        case 4:
            chunks[place] = (name, blindly(random, content))
        case 5:
            header = bytearray(chunks[0][1])
            if random.uniform() < 0.5:
                size = struct.pack(">I", random.choice([*EDGES[:13], 5, 13000, 20000]))
                at = int(random.choice([0, 4]))
                header[at : at + 4] = size
            else:
                header[random.integers(8, 13)] = random.choice([0, 1, 2, 3, 4, 5, 6, 8, 16, 255])
            chunks[0] = (b"IHDR", bytes(header))
        case _:
            # The decompressed rows, changed and packed again.
            rows = zlib.decompress(b"".join(content for name, content in chunks if name == b"IDAT"))
            packed = (b"IDAT", zlib.compress(blindly(random, rows)))
            others = [chunk for chunk in chunks if chunk[0] != b"IDAT"]
            chunks = [*others[:-1], packed, *others[-1:]]
    return PNG_SIGNATURE + b"".join(png_chunk(*chunk) for chunk in chunks)


def jpeg_segment(marker: int, content: bytes) -> bytes:
    """A segment with its length."""
    return struct.pack(">BBH", 0xFF, marker, len(content) + 2) + content


def jpeg_segments(data: bytes) -> tuple[list[tuple[int, bytes]], bytes]:
    """Markers and contents up to the first scan, and the rest of the file."""
    segments, place = [], 2
    while True:
        _, marker, length = struct.unpack_from(">BBH", data, place)
        segments.append((marker, data[place + 4 : place + 2 + length]))
        place += 2 + length
        if marker == 0xDA:
            return segments, data[place:]


def _jpeg(random: Generator, data: bytes) -> bytes:
    segments, rest = jpeg_segments(data)
    place, other = (int(number) for number in random.integers(0, len(segments), 2))
    marker, content = segments[place]
    match random.integers(6):
        case 0:
            segments[place], segments[other] = segments[other], segments[place]
        case 1:
            segments.insert(other, segments[place])
        case 2:
            del segments[place]
        case 3:
            segments[place] = (marker, blindly(random, content))
        case 4:
            # Height and width of the frame's header.
            for number, (marker, content) in enumerate(segments):
                if 0xC0 <= marker <= 0xC3:
                    size = struct.pack(">HH", *random.choice([0, 1, 5, 4000, 0xFFFF], 2))
                    segments[number] = (marker, content[:1] + size + content[5:])
        case _:
            for number, (marker, content) in enumerate(segments):
                if content.startswith(b"Exif\0\0"):
                    segments[number] = (marker, content[:6] + tiff(random, content[6:]))
    return b"\xff\xd8" + b"".join(jpeg_segment(marker, content[:65533]) for marker, content in segments) + rest


@dataclass(frozen=True)
class _Directories:
    """Where the entries of a TIFF file are, and how they are written."""

    order: str
    """< or >."""
    number: str
    """Format of counts and offsets: I, or Q in BigTIFF."""
    starts: list[int]
    entries: list[int]
    links: list[int]
    """Places of the offsets of the next directory."""

    @property
    def entry_bytes(self) -> int:
        return 12 if self.number == "I" else 20

    @property
    def number_bytes(self) -> int:
        return 4 if self.number == "I" else 8


def _directories(data: bytes) -> _Directories:
    order = "<" if data[:2] == b"II" else ">"
    big = struct.unpack_from(order + "H", data, 2)[0] == 43
    number, count, link = ("Q", "Q", 8) if big else ("I", "H", 4)
    found = _Directories(order, number, [], [], [link])
    pending = [struct.unpack_from(order + number, data, link)[0]]
    while pending:
        start = pending.pop()
        if start == 0 or start in found.starts:
            continue
        (entries,) = struct.unpack_from(order + count, data, start)
        begin = start + (8 if big else 2)
        found.starts.append(start)
        for place in range(begin, begin + entries * found.entry_bytes, found.entry_bytes):
            (tag,) = struct.unpack_from(order + "H", data, place)
            found.entries.append(place)
            if tag in (EXIF_POINTER, 330):
                pending.append(struct.unpack_from(order + number, data, place + 4 + found.number_bytes)[0])
        found.links.append(begin + entries * found.entry_bytes)
        pending.append(struct.unpack_from(order + number, data, found.links[-1])[0])
    return found


def tiff(random: Generator, data: bytes) -> bytes:
    """A change to one entry of a directory, or to where a directory leads."""
    found = _directories(data)
    changed = bytearray(data)

    def some_number() -> int:
        """An edge, an offset in the file, or little."""
        kind = random.integers(4)
        if kind == 0:
            return EDGES[random.integers(len(EDGES))] % (1 << 8 * found.number_bytes)
        if kind == 1:
            return int(random.integers(0, len(data) + 8))
        return int(random.choice(found.starts)) if kind == 2 else int(random.integers(0, 70))

    entry = int(random.choice(found.entries))
    match random.integers(7):
        case 0:
            types = [0, *_TYPE_BYTES, 14, 129, 0xFFFF]
            struct.pack_into(found.order + "H", changed, entry + 2, types[random.integers(len(types))])
        case 1:
            struct.pack_into(found.order + found.number, changed, entry + 4, some_number())
        case 2:
            struct.pack_into(found.order + found.number, changed, entry + 4 + found.number_bytes, some_number())
        case 3:
            struct.pack_into(found.order + "H", changed, entry, random.choice(_TAGS))
        case 4:
            struct.pack_into(found.order + found.number, changed, int(random.choice(found.links)), some_number())
        case 5:
            # The tag's own value, in the place and width that its type gives it.
            type_, count = struct.unpack_from(found.order + "H" + found.number, data, entry + 2)
            width = _TYPE_BYTES.get(type_, 4)
            place = entry + 4 + found.number_bytes
            if width * count > found.number_bytes:
                (place,) = struct.unpack_from(found.order + found.number, data, place)
            number = some_number() % (1 << 8 * width)
            changed[place : place + width] = number.to_bytes(width, "little" if found.order == "<" else "big")
        case _:
            other, size = int(random.choice(found.entries)), found.entry_bytes
            changed[entry : entry + size] = data[other : other + size]
            if random.uniform() < 0.5:
                changed[other : other + size] = data[entry : entry + size]
    return bytes(changed)


def _npy(random: Generator, data: bytes) -> bytes:
    """Another word in the header, or all of it replaced, with the right length."""
    (length,) = struct.unpack_from("<H", data, 8)
    header, content = data[10 : 10 + length].decode("latin-1"), data[10 + length :]
    words: dict[str, tuple[str, ...]] = {
        "'descr': ": ("'<f4'", "'>f8'", "'|O'", "'<U3'", "'<c16'", "'<M8[s]'", "'|V8'", "[('a', '<f8')]", "3", "'f'"),
        "'fortran_order': ": ("True", "False", "3", "None"),
        "'shape': ": ("()", "(0,)", "(-1, 3)", "(3, 1000000000)", "(2**9, 1)", "(1, 2, 3)", "3", "('a',)", "(1.5, 2)"),
    }
    name = list(words)[random.integers(len(words))]
    begin = header.index(name) + len(name)
    end = header.index(", '" if name != "'shape': " else ")", begin) + (name == "'shape': ")
    header = header[:begin] + words[name][random.integers(len(words[name]))] + header[end:]
    if random.uniform() < 0.1:
        header = ("{}", "(" * 3000, "[" * 200, "{'descr': 1}", "\0", "1 +", "x" * 20000)[random.integers(7)]
    encoded = header.encode("latin-1")
    version = bytes(random.choice([[1, 0], [1, 0], [2, 0], [3, 0], [9, 1]]).astype("u1"))
    size = struct.pack("<H" if version[0] < 2 else "<I", len(encoded))
    return data[:6] + version + size + encoded + content


def text_mutated(random: Generator, text: str) -> str:
    """Words between commas, colons and line ends replaced, dropped or doubled."""
    odd: tuple[str, ...] = (
        "nan",
        "inf",
        "-1",
        "0",
        "1e999",
        "-1e300",
        "1e-320",
        "",
        '"',
        "'",
        "x",
        "\0",
        "é",
        "[" * 5000,
        "{}",
        "[]",
    )
    odd += ("null", "true", "1,2", "\n", "\r", "1_0", "٣", "0x10", "9" * 400, '"depth"', "NaN", "Infinity", "-0")
    for _ in range(random.integers(1, 4)):
        places = list(_words(text))
        if not places:
            return text
        begin, end = places[random.integers(len(places))]
        match random.integers(4):
            case 0:
                text = text[:begin] + text[end:]
            case 1:
                text = text[:end] + text[begin:end] + text[end:]
            case _:
                text = text[:begin] + odd[random.integers(len(odd))] + text[end:]
    return text


def _words(text: str) -> Iterator[tuple[int, int]]:
    begin = 0
    for place, letter in enumerate(text):
        if letter in ",:\n[]{}":
            if place > begin:
                yield begin, place
            yield place, place + 1
            begin = place + 1
    if begin < len(text):
        yield begin, len(text)
