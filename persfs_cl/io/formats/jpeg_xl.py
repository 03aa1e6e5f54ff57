"""How large a JPEG XL picture says that it is, which its decoder would make room for."""

from __future__ import annotations

_CODESTREAM, _BOXES = b"\xff\x0a", b"\0\0\0\x0cJXL \r\n\x87\n"
SIGNATURES = (_CODESTREAM, _BOXES)
_RATIOS = {1: (1, 1), 2: (12, 10), 3: (4, 3), 4: (3, 2), 5: (16, 9), 6: (5, 4), 7: (2, 1)}
"""Width to height, by the numbers of the format."""


def jpeg_xl_shape(data: bytes) -> tuple[int, int]:
    """Height and width (ISO/IEC 18181-1, SizeHeader); IndexError where the header is not there."""
    place = 0
    if data.startswith(_BOXES):
        place = min((at + 4 for at in (data.find(b"jxlc"), data.find(b"jxlp") + 4) if at > 4), default=len(data))
    bits = _Bits(data[place + 2 : place + 34])
    small = bits.take(1)

    def side() -> int:
        return 8 * (bits.take(5) + 1) if small else bits.take((9, 13, 18, 30)[bits.take(2)]) + 1

    height = side()
    ratio = bits.take(3)
    if ratio:
        wide, high = _RATIOS[ratio]
        return height, height * wide // high
    return height, side()


class _Bits:
    """Bits in their order, the lowest of each byte first."""

    def __init__(self, data: bytes) -> None:
        self._number, self._left = int.from_bytes(data, "little"), 8 * len(data)

    def take(self, count: int) -> int:
        if count > self._left:
            raise IndexError("the header breaks off")
        taken = self._number & ((1 << count) - 1)
        self._number >>= count
        self._left -= count
        return taken
