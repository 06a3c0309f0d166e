"""Where two blocks are enough: as its twin says, and not where noise, steps or the other eye forbid it."""

import numpy as np
import pytest

from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.guided.easy import LARGEST_RATIO, LEAST_GRADIENT, easy_squares
from digs_warp.sim.sensor.guided.planes import make_planes
from reference.guided_twin import twin_easy
from reference.stereo_frames import broadband
from reference.stereo_pairs import plane_pair


def noisy_plane(noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two noisy images of a plane at 20.4 px with a contrast of 10 DN, and its disparity."""
    truth = plane_pair(20.4)
    rng = np.random.default_rng(99)  # not the seed of the texture
    pair = [120 + 0.25 * (gray_of(image) - 120.0) for image in (truth.image, truth.right)]
    left, right = (
        np.clip(np.rint(image + noise * rng.standard_normal(image.shape)), 0, 255).astype(np.uint8)
        for image in pair
    )
    return left, right, truth.disparity


@pytest.mark.parametrize("shape", [(64, 120), (9, 61), (16, 18)])
def test_squares_equal_the_twin(shape: tuple[int, int]) -> None:
    left, right, surface = (image[: shape[0], : shape[1]] for image in noisy_plane(2.0))
    surface = surface + np.linspace(0, 1.5, shape[1], dtype=np.float32)
    left, right = np.ascontiguousarray(left), np.ascontiguousarray(right)
    found = easy_squares(make_planes(left, right, 48), surface)
    twin = twin_easy(left, right, surface, LARGEST_RATIO, LEAST_GRADIENT)
    np.testing.assert_array_equal(found, twin)
    assert shape[0] < 64 or 0.1 < found.mean() < 0.9, "or nothing was compared"


@pytest.mark.parametrize("noise", [0.0, 1.0, 3.0, 10.0, 30.0])
def test_noise_alone_is_never_easy(noise: float) -> None:
    rng = np.random.default_rng(0)
    images = 120 + noise * rng.standard_normal((2, 160, 320))
    left, right = np.clip(np.rint(images), 0, 255).astype(np.uint8)
    surface = np.full(left.shape, 20, np.float32)
    assert not easy_squares(make_planes(left, right, 48), surface).any()


def test_texture_is_easy_until_noise_drowns_it_and_only_at_the_right_disparity() -> None:
    shares = []
    for noise in (0.5, 7.0, 16.0):
        left, right, surface = noisy_plane(noise)
        easy = easy_squares(make_planes(left, right, 48), surface)
        shares.append(easy[:, 5:].mean())
    assert shares[0] > 0.9 > shares[1] > 0.1 and shares[2] == 0
    left, right, surface = noisy_plane(0.5)
    assert not easy_squares(make_planes(left, right, 48), surface + 5).any()


def test_what_the_right_eye_cannot_see_is_not_easy() -> None:
    left, right, surface = noisy_plane(0.5)
    easy = easy_squares(make_planes(left, right, 48), surface)
    assert not easy[:, :3].any(), "20 columns are outside its image"
    right = right.copy()
    right[:, 60:80] = broadband(right.shape, 9)[:, 60:80, 0]  # something else hides it there
    hidden = easy_squares(make_planes(left, right, 48), surface)
    assert not hidden[:, 10:13].any() and easy[:, 10:13].mean() > 0.9


@pytest.mark.parametrize("shape", [(1, 1), (7, 100), (100, 9), (8, 10), (8, 9), (300, 5)])
def test_images_without_whole_squares_have_none(shape: tuple[int, int]) -> None:
    image = np.zeros(shape, np.uint8)
    easy = easy_squares(make_planes(image, image, 32), np.zeros(shape, np.float32))
    assert easy.shape == (shape[0] // 8, max(shape[1] - 2, 0) // 8) and not easy.any()
