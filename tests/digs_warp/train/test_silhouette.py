"""The object's own color at the silhouette: against a float64 twin, and where masks are odd."""

import numpy as np

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
    """The formulas of the module, pixel by pixel."""
    found = image.astype(np.float64)
    for y, x in zip(*np.nonzero((mask > 0) & (mask < 255)), strict=True):
        sums = {255: [np.zeros(3), 0.0], 0: [np.zeros(3), 0.0]}
        colors = []
        for dy in range(-REACH, REACH + 1):
            for dx in range(-REACH, REACH + 1):
                v, u = y + dy, x + dx
                if not (0 <= v < mask.shape[0] and 0 <= u < mask.shape[1]):
                    continue
                kind = int(mask[v, u])
                if kind in sums:
                    weight = np.exp(-(dy**2 + dx**2) / 4.0)
                    sums[kind][0] += weight * image[v, u].astype(np.float64)
                    sums[kind][1] += weight
                if kind == 255:
                    colors.append(image[v, u].astype(np.float64))
        if not colors:
            continue
        near = sums[255][0] / sums[255][1]
        m = mask[y, x] / 255
        color = near
        if sums[0][1] > 0:
            room = sums[0][0] / sums[0][1]
            color = (m * (image[y, x] - (1 - m) * room) + NEIGHBORS * near) / (m**2 + NEIGHBORS)
        low, high = np.min(colors, axis=0) - MARGIN, np.max(colors, axis=0) + MARGIN
        found[y, x] = np.clip(np.clip(color, low, high), 0, 255)
    return found


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
