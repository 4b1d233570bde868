"""A picture that somebody drew, as darkness: upright, bounded, paper where nothing is."""

import numpy as np
import pytest
from PIL import Image

from slam_uwb.io import read_picture
from slam_uwb.model.errors import SurveyFormatError


def test_dark_is_one_and_the_first_row_is_the_lowest(tmp_path):
    grey = np.full((4, 6), 255, dtype=np.uint8)
    grey[3, 0] = 0
    Image.fromarray(grey).save(tmp_path / "plan.png")
    darkness, pixels_a_cell, size = read_picture(tmp_path / "plan.png")
    assert (darkness.shape, pixels_a_cell, size) == ((4, 6), 1.0, (6, 4))
    assert darkness[0, 0] == 1.0
    assert darkness.sum() == 1.0


def test_what_is_transparent_is_paper(tmp_path):
    Image.new("RGBA", (3, 2), (0, 0, 0, 0)).save(tmp_path / "plan.png")
    assert read_picture(tmp_path / "plan.png")[0].max() == 0.0


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "CMYK"])
def test_all_kinds_of_pictures(tmp_path, mode):
    name = tmp_path / ("plan.jpg" if mode == "CMYK" else "plan.png")
    image = Image.new("RGB", (8, 4), "white")
    image.paste("black", (0, 0, 4, 4))
    image.convert(mode).save(name)
    darkness, _, _ = read_picture(name)
    np.testing.assert_allclose(darkness[:, :3], 1.0, atol=0.1)
    np.testing.assert_allclose(darkness[:, 5:], 0.0, atol=0.1)


def test_a_large_picture_is_kept_coarser(tmp_path):
    Image.new("L", (3000, 600), 255).save(tmp_path / "plan.png")
    darkness, pixels_a_cell, size = read_picture(tmp_path / "plan.png")
    assert (darkness.shape, pixels_a_cell, size) == ((240, 1200), 2.5, (3000, 600))


def test_a_photograph_is_read_as_it_is_shown(tmp_path):
    """Taken with the telephone on its side: stored 6 x 4, shown 4 x 6."""
    image = Image.new("L", (6, 4), 255)
    exif = image.getexif()
    exif[0x0112] = 6
    image.save(tmp_path / "plan.jpg", exif=exif)
    assert read_picture(tmp_path / "plan.jpg")[2] == (4, 6)


@pytest.mark.parametrize("content", [b"", b"no picture", b"\x89PNG\r\n\x1a\n broken"])
def test_what_is_no_picture_is_refused(tmp_path, content):
    (tmp_path / "plan.png").write_bytes(content)
    with pytest.raises(SurveyFormatError, match="no picture that can be read"):
        read_picture(tmp_path / "plan.png")


def test_a_truncated_picture_is_refused(tmp_path):
    noise = np.random.default_rng(1).integers(0, 255, (60, 60), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "whole.png")
    whole = (tmp_path / "whole.png").read_bytes()
    (tmp_path / "plan.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SurveyFormatError, match=r"plan\.png"):
        read_picture(tmp_path / "plan.png")


def test_a_huge_picture_is_refused_before_it_is_expanded(tmp_path):
    Image.new("1", (9000, 9000)).save(tmp_path / "plan.png")
    with pytest.raises(SurveyFormatError, match="9000 x 9000 pixels, the limit is"):
        read_picture(tmp_path / "plan.png")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(SurveyFormatError, match=r"none\.png"):
        read_picture(tmp_path / "none.png")
