"""The object's own color at the silhouette: against a float64 twin, and where masks are odd."""

import numpy as np
from scipy.ndimage import convolve, maximum_filter, minimum_filter

from digs_warp.train.silhouette import MARGIN, NEIGHBORS, REACH, without_surround

HEIGHT, WIDTH = 24, 30


def scene() -> tuple[np.ndarray, np.ndarray]:
    """A red-to-yellow disc before a blue room: photograph and mask."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    distance = np.hypot(rows - 11.5, columns - 14.5)
    mask = np.rint(255 * np.clip(8.0 - distance, 0, 1)).astype(np.uint8)
    disc = np.stack([200 + 0 * rows, 4 * columns, 20 + 2 * rows], axis=-1).astype(np.float64)
    room = np.stack([10 + rows, 60 + 0 * rows, 230 - columns], axis=-1).astype(np.float64)
    share = mask[..., None] / 255
    photo = np.rint(share * disc + (1 - share) * room).astype(np.uint8)
    return photo, mask


def twin(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The formulas of the module, in whole arrays."""
    reach, m, values = np.arange(-REACH, REACH + 1), mask[..., None] / 255, image.astype(np.float64)
    kernel = np.exp(-(reach[:, None, None] ** 2 + reach[:, None] ** 2) / 4.0)

    def mean(kind: int) -> np.ndarray:
        here = (mask == kind)[..., None].astype(np.float64)
        sums = (convolve(each, kernel, mode="constant") for each in (here * values, here))
        return np.divide(*sums)  # NaN where there are none

    with np.errstate(invalid="ignore"):
        near, room = mean(255), mean(0)
    color = (m * (values - (1 - m) * room) + NEIGHBORS * near) / (m**2 + NEIGHBORS)
    color = np.where(np.isnan(room), near, color)
    window = (len(reach), len(reach), 1)
    low = minimum_filter(np.where(m == 1, values, np.inf), window) - MARGIN
    high = maximum_filter(np.where(m == 1, values, -np.inf), window) + MARGIN
    found = np.clip(np.clip(color, low, high), 0, 255)
    return np.where((m > 0) & (m < 1) & ~np.isnan(near), found, values)


def test_agrees_with_the_twin() -> None:
    photo, mask = scene()
    rng = np.random.default_rng(0)
    noisy = np.clip(photo + rng.normal(0, 12, photo.shape), 0, 255).astype(np.uint8)
    cut = np.s_[5:12, 12:22]  # the rim at the edge of the image
    for part in (np.s_[:], cut):
        for image in (photo[part], noisy[part]):
            expected = twin(image, mask[part])
            assert np.abs(without_surround(image, mask[part]) - expected).max() <= 0.51


def test_a_hard_or_a_constant_mask_changes_nothing() -> None:
    photo, mask = scene()
    hard = np.where(mask >= 128, 255, 0).astype(np.uint8)
    assert without_surround(photo, hard) is photo
    for level in (0, 128, 255):
        found = without_surround(photo, np.full((HEIGHT, WIDTH), level, np.uint8))
        assert np.array_equal(found, photo)
