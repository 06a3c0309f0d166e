"""What a view is compared with: composited over the background, from the crop of its mask."""

import numpy as np
import pytest
import warp as wp

from digs_warp.device.image_planes import ImagePlanes
from digs_warp.geometry.rigid import PixelBox, mask_box
from digs_warp.losses.regions import loss_blocks, read_region
from digs_warp.losses.target import Target, pack_view
from digs_warp.measure.color_gain import SATURATED, ColorGain

BACKGROUND = np.array([0.1, 0.6, 0.9])


@pytest.fixture(autouse=True, params=["a row", "a pixel"])
def part_of_a_thread(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thread of a GPU fills a pixel."""
    if request.param == "a pixel":
        monkeypatch.setattr("digs_warp.losses.target.values_per_thread", lambda *_: 1)


WHOLE = (0, 0, 31, 19)


def pixels_of(image: np.ndarray, mask: np.ndarray) -> wp.array:
    return wp.array(pack_view(image, mask), dtype=wp.uint8, device="cpu")


def composed(image: np.ndarray, mask: np.ndarray, region: PixelBox) -> np.ndarray:
    height, width = mask.shape
    box = mask_box(mask)
    inside = (slice(box[1], box[3]), slice(box[0], box[2]))
    target = Target(width, height)
    target.compose(pixels_of(image[inside], mask[inside]), box, BACKGROUND, region, (width, height))
    return target.image.to_numpy()


def photograph(empty_border: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (19, 31, 3), dtype=np.uint8)
    mask = rng.integers(0, 256, (19, 31), dtype=np.uint8)
    mask[:empty_border] = mask[:, :empty_border] = 0
    return image, mask


@pytest.mark.parametrize("border", [0, 7])
def test_the_target_is_composited_over_the_background(border: int) -> None:
    image, mask = photograph(border)
    target = composed(image, mask, WHOLE)
    expected = mask[..., None] / 255.0
    np.testing.assert_allclose(
        target, image / 255.0 * expected + BACKGROUND * (1 - expected), atol=1e-6
    )


def test_only_the_region_is_filled() -> None:
    image, mask = photograph(3)
    whole = composed(image, mask, WHOLE)
    part = composed(image, mask, (5, 2, 20, 11))
    np.testing.assert_array_equal(part[2:11, 5:20], whole[2:11, 5:20])
    assert np.count_nonzero(part) == np.count_nonzero(part[2:11, 5:20])


def test_a_gain_is_taken_off_the_photograph() -> None:
    image, mask = photograph(0)
    rendered = ImagePlanes.of(np.random.default_rng(1).uniform(0, 2, (19, 31, 3)))
    gain = ColorGain(np.array([0.4, -0.3, 0.1]))
    target = Target(31, 19)
    pixels = pixels_of(image, mask)
    target.compose(pixels, WHOLE, BACKGROUND, WHOLE, (31, 19), gain=gain, rendered=rendered)
    share = mask[..., None] / 255.0
    plain = (image / 255.0 + 0.055) / np.exp(gain.log_factors) - 0.055
    expected = plain * share + BACKGROUND * (1 - share)
    # A clipped value says how bright the object is at least.
    clipped = image >= SATURATED
    expected[clipped] = np.maximum(expected, rendered.to_numpy())[clipped]
    assert (expected > rendered.to_numpy())[clipped].any()
    np.testing.assert_allclose(target.image.to_numpy(), expected, atol=1e-5)
    target.compose(pixels, WHOLE, BACKGROUND, WHOLE, (31, 19))
    again = composed(image, mask, WHOLE)
    np.testing.assert_array_equal(target.image.to_numpy(), again)


def test_a_smaller_view_finds_nothing_of_a_larger_one() -> None:
    target = Target(40, 30)
    image = np.full((30, 40, 3), 200, np.uint8)
    pixels = pixels_of(image, image[..., 0])
    target.compose(pixels, (0, 0, 40, 30), BACKGROUND, (0, 0, 40, 30), (40, 30))
    small = pixels_of(image[:9, :8], image[:9, :8, 0])
    target.compose(small, (0, 0, 8, 9), BACKGROUND, (0, 0, 8, 9), (8, 9))
    assert np.count_nonzero(target.image.to_numpy()) == 8 * 9 * 3


def test_the_loss_looks_one_tile_further_and_reads_a_window_more() -> None:
    content, drawn = np.zeros((60, 60), dtype=bool), np.zeros((60, 60), dtype=bool)
    content[10, 11] = True  # one further lies in the next block of four tiles
    blocks = loss_blocks(content, drawn)
    assert np.argwhere(blocks).tolist() == [[r, c] for r in (9, 10, 11) for c in (2, 3)]
    assert read_region(blocks, (960, 960)) == (123, 139, 261, 197)
    drawn[0, 0] = True
    assert read_region(loss_blocks(content, drawn), (960, 960)) == (0, 0, 261, 197)
    assert read_region(loss_blocks(drawn & content, drawn & content), (960, 960)) == (0, 0, 0, 0)
