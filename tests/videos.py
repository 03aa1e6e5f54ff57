"""Small videos, written without the code under test."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray


def make_video(
    path: Path,
    frames: Iterable[NDArray[np.uint8]],
    *,
    codec: str = "ffv1",
    pixels: str = "bgr0",
    uneven: bool = False,
) -> list[NDArray[Any]]:
    """Write frames, (height, width, 3), and tell what they decode to, one after the other.

    By default they lose nothing. `uneven` is whether the time between them varies. Codecs that can have B-frames, have.
    """
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(codec, rate=Fraction(30000, 1001))
        stream.codec_context.gop_size = 6
        # Starting others takes longer than the few frames.
        stream.codec_context.thread_count = 1
        time = 0
        for number, samples in enumerate(frames):
            if not number:
                stream.height, stream.width, stream.pix_fmt = *samples.shape[:2], pixels
            frame = av.VideoFrame.from_ndarray(samples).reformat(format=pixels)
            if uneven:
                stream.codec_context.time_base = frame.time_base = Fraction(1, 1000)
                frame.pts = time
                time += 20 + 13 * (number % 5)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
