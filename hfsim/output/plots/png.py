"""Pictures of pixels to files."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from hfsim.maths.arrays import Array

_LEVEL = 2
"""Of compression: files are as small as the library's, which tries filters for each row, in half the time."""
_INCH = 0.0254


def write_png(path: Path, pixels: Array, dpi: float) -> None:
    """Write an opaque picture.

    Parameters
    ----------
    pixels : ndarray of uint8, shape (height, width, 3 or 4)
        Red, green, blue.
    dpi : float
        Pixels to the inch.
    """
    height, width = pixels.shape[:2]
    rows = np.zeros((height, 1 + 3 * width), np.uint8)  # each begins with the number of its filter: none
    for colour in range(3):  # five times as quick as all three at once
        rows[:, 1 + colour :: 3] = pixels[..., colour]
    to_the_metre = round(dpi / _INCH)
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"pHYs", struct.pack(">IIB", to_the_metre, to_the_metre, 1)),
        (b"IDAT", zlib.compress(rows.tobytes(), _LEVEL)),
        (b"IEND", b""),
    )
    with path.open("wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for kind, data in parts:
            check = zlib.crc32(kind + data)
            file.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check))
