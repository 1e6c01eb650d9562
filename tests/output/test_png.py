"""Pictures of pixels are files that others read."""

import numpy as np
from PIL import Image

from hfsim.output.plots.png import write_png


def test_a_picture_is_read_as_it_was_written(tmp_path):
    pixels = np.random.default_rng(1).integers(0, 256, (5, 7, 4), np.uint8)
    write_png(tmp_path / "one.png", pixels, 110.0)
    with Image.open(tmp_path / "one.png") as image:
        assert image.mode == "RGB" and image.size == (7, 5)
        assert np.array_equal(np.asarray(image), pixels[..., :3])
        assert np.allclose(image.info["dpi"], 110.0, atol=0.02)
