"""The fused loss kernels against the plain float64 metric, and the properties of both."""

import numpy as np
import pytest

from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.device.image_planes import ImagePlanes
from digs_warp.losses import photometric
from digs_warp.losses.photometric import PhotometricLoss
from digs_warp.losses.regions import blocks_of, loss_blocks, tiles_of
from digs_warp.measure.color_gain import MOST_STOPS, fit_color_gain
from digs_warp.measure.metrics import psnr, ssim_map
from digs_warp.measure.ssim import window_weights
from digs_warp.measure.ssim_pixels import similarity_of_pixels

# Sizes below, at and across the kernel's blocks of 64 x 16.
SIZES = [(1, 1), (64, 16), (150, 70)]


@pytest.fixture(autouse=True, params=["for CPUs", "for GPUs"])
def kernels(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """All tests here are of both kinds of kernels."""
    if request.param == "for GPUs":
        monkeypatch.setattr(photometric, "similarity_of_strips", similarity_of_pixels)


def brute_force_ssim(x: np.ndarray, y: np.ndarray, row: int, column: int) -> float:
    """SSIM of one pixel of one channel, straight from the definition."""
    weights = np.outer(window_weights(), window_weights())
    patch_x, patch_y = (np.pad(a, 5)[row : row + 11, column : column + 11] for a in (x, y))
    mean_x, mean_y = (weights * patch_x).sum(), (weights * patch_y).sum()
    var_x = (weights * (patch_x - mean_x) ** 2).sum()
    var_y = (weights * (patch_y - mean_y) ** 2).sum()
    covariance = (weights * (patch_x - mean_x) * (patch_y - mean_y)).sum()
    luminance = (2 * mean_x * mean_y + 1e-4) / (mean_x**2 + mean_y**2 + 1e-4)
    return luminance * (2 * covariance + 9e-4) / (var_x + var_y + 9e-4)


def noisy_pair(width: int, height: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    target = rng.uniform(size=(height, width, 3)).astype(np.float32)
    noise = rng.normal(size=target.shape).astype(np.float32) * 0.1
    return np.clip(target + noise, 0, 1), target


def run_loss(image: np.ndarray, target: np.ndarray, room: int = 0) -> tuple[float, np.ndarray]:
    height, width = image.shape[:2]
    _, adj, loss = compared(image, target, room)
    everything = blocks_of(tiles_of(np.ones((height, width))))
    loss.run((width, height), everything)
    return loss.value(), adj.to_numpy()


def compared(
    image: np.ndarray, target: np.ndarray, room: int = 0
) -> tuple[ImagePlanes, ImagePlanes, PhotometricLoss]:
    """Planes of the image and of its gradient, with room for a larger one, and the loss beside the target."""
    height, width = image.shape[:2]
    planes, goal, adj = (ImagePlanes(width + room, height + room, 3) for _ in range(3))
    for each in (planes, goal, adj):
        each.resize(width, height)
    planes.assign(image)
    goal.assign(target)
    return planes, adj, PhotometricLoss(planes, goal, adj)


def test_the_metric_is_the_definition_of_ssim() -> None:
    x, y = (a[..., 0].astype(np.float64) for a in noisy_pair(30, 20))
    values = ssim_map(x[..., None], y[..., None])[..., 0]
    for row, column in [(0, 0), (7, 9), (19, 29), (3, 28)]:
        # The metric uses E[x^2] - E[x]^2, equal to the definition for weights that sum to 1.
        assert values[row, column] == pytest.approx(brute_force_ssim(x, y, row, column), abs=1e-12)


@pytest.mark.parametrize("place", [(0, 0), (33, 45)])
def test_where_images_are_equal_but_for_a_part_the_metrics_are_those_of_the_whole(
    place: tuple[int, int],
) -> None:
    target = noisy_pair(48, 36)[1].astype(np.float64)
    image, (row, column) = target.copy(), place
    image[row : row + 3, column : column + 3] *= 0.5
    values = ssim_map(image, target)
    for y in range(36):
        for x in range(48):
            expected = brute_force_ssim(image[..., 1], target[..., 1], y, x)
            assert values[y, x, 1] == pytest.approx(expected, abs=1e-9)
    assert psnr(image, target) == pytest.approx(-10 * np.log10(((image - target) ** 2).mean()))


def test_psnr_of_a_known_error() -> None:
    target = np.full((8, 9, 3), 0.5)
    assert psnr(target + 0.1, target) == pytest.approx(20.0)
    mask = np.zeros((8, 9), dtype=bool)
    mask[2, 3] = True
    changed = target.copy()
    changed[2, 3] += 0.01
    assert psnr(changed, target, mask) == pytest.approx(40.0)
    assert np.isnan(psnr(target, target, np.zeros((8, 9), dtype=bool)))


@pytest.mark.parametrize(("width", "height", "room"), [*((*s, 0) for s in SIZES), (70, 20, 90)])
def test_the_kernel_equals_the_metric_and_its_differences(
    width: int, height: int, room: int
) -> None:
    image, target = noisy_pair(width, height, seed=1)
    loss, gradient = run_loss(image, target, room)
    x, y = image.astype(np.float64), target.astype(np.float64)

    def objective(values: np.ndarray) -> float:
        return 0.8 * np.abs(values - y).mean() + 0.2 * (1 - ssim_map(values, y).mean())

    assert loss == pytest.approx(objective(x), rel=1e-5)
    rng = np.random.default_rng(0)
    for _ in range(12):
        index = (rng.integers(height), rng.integers(width), rng.integers(3))
        if abs(x[index] - y[index]) < 1e-5:
            continue  # L1 has no derivative where both agree
        step = np.zeros_like(x)
        step[index] = 1e-6
        slope = (objective(x + step) - objective(x - step)) / 2e-6
        assert gradient[index] == pytest.approx(slope, rel=2e-4, abs=2e-4 / x.size)


def test_the_region_of_interest_changes_nothing() -> None:
    """Loss and gradient around a small object are those of the whole image, wherever it lies."""
    width, height = 150, 70
    rng = np.random.default_rng(3)
    for x0, y0 in [(0, 0), (60, 20), (130, 55), (100, 2)]:
        image = np.full((height, width, 3), 0.7, np.float32)
        target = image.copy()
        box = (x0, y0, min(x0 + 20, width), min(y0 + 15, height))
        inside = (slice(box[1], box[3]), slice(box[0], box[2]))
        image[inside] = rng.uniform(size=image[inside].shape)
        target[inside] = rng.uniform(size=target[inside].shape)
        whole, whole_gradient = run_loss(image, target)
        _, adj, loss = compared(image, target)
        marked = np.zeros((height, width))
        marked[inside] = 1
        loss.run((width, height), loss_blocks(tiles_of(marked), tiles_of(marked)))
        assert loss.value() == pytest.approx(whole, rel=1e-6)
        np.testing.assert_allclose(
            adj.to_numpy()[inside], whole_gradient[inside], rtol=1e-5, atol=1e-10
        )


def test_a_region_from_the_view_before_leaves_no_trace() -> None:
    width, height = 150, 70
    image, target = noisy_pair(width, height)
    planes, adj, goal = (ImagePlanes(width, height, 3) for _ in range(3))
    planes.assign(image)
    goal.assign(target)
    loss = PhotometricLoss(planes, goal, adj)
    everything = blocks_of(tiles_of(np.ones((height, width))))
    loss.run((width, height), everything)
    flat = np.full((height, width, 3), 0.2, np.float32)
    planes.assign(flat)
    goal.assign(flat)
    marked = np.zeros((height, width))
    marked[50:60, 100:110] = 1
    loss.run((width, height), loss_blocks(tiles_of(marked), tiles_of(marked)))
    assert loss.value() == pytest.approx(0.0, abs=1e-7)
    assert np.abs(adj.to_numpy()[50:60, 100:110]).max() < 1e-9


def test_same_bits_for_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("DIGS_WARP_THREADS", threads)
        found.append(run_loss(*noisy_pair(200, 90)))
    one, more = found
    assert one[0] == more[0]
    np.testing.assert_array_equal(one[1], more[1])


STOPS = np.array([0.7, -0.4, 0.1])


def colors(count: int = 400) -> np.ndarray:
    return np.random.default_rng(0).uniform(0.1, 0.6, (count, 3))


def photographed(scene: np.ndarray, stops: np.ndarray = STOPS) -> np.ndarray:
    """Return what a camera with this gain records, 8 bits, clipped."""
    light = linear_from_srgb(scene) * 2.0**stops
    return np.rint(255 * np.clip(srgb_from_linear(light), 0, 1)) / 255


def test_clipped_and_black_pixels_tell_nothing() -> None:
    bright = np.array([2.0, 2.0, 2.0])
    photo = photographed(colors(), bright)
    assert (photo == 1).mean() > 0.1
    photo[::7] = 0
    np.testing.assert_allclose(fit_color_gain(colors(), photo).stops, bright, atol=0.02)


@pytest.mark.parametrize("photo", [np.ones((400, 3)), np.zeros((0, 3))])
def test_without_a_usable_pixel_there_is_no_gain(photo: np.ndarray) -> None:
    scene = colors()[: len(photo)]
    np.testing.assert_array_equal(fit_color_gain(scene, photo).stops, 0)
    before = np.array([0.1, 0.2, 0.3])
    np.testing.assert_array_equal(fit_color_gain(scene, photo, before).log_factors, before)


@pytest.mark.parametrize("value", [np.nan, -1.0])
def test_any_rendering_gives_a_finite_gain_within_limits(value: float) -> None:
    scene = colors()
    scene[:, 1] = value
    stops = fit_color_gain(scene, photographed(colors())).stops
    assert np.all(np.abs(stops) <= MOST_STOPS + 1e-9)


@pytest.mark.parametrize("count", [17, 400])
def test_the_gain_is_that_of_huber_weights_around_the_median(count: int) -> None:
    """Bit for bit: the medians are NumPy's, for odd and even numbers of pixels."""
    scene, photo = colors(count), photographed(colors(count))
    photo[::5] *= 0.7
    for channel in range(3):
        x, y = scene[:, channel] + 0.055, photo[:, channel] + 0.055
        factor = np.median(y / x)
        for _ in range(4):
            residuals = np.abs(y - factor * x)
            allowed = 1.345 * max(1.4826 * np.median(residuals), 1 / (255 * 12**0.5))
            weighted = allowed / np.maximum(residuals, allowed) * x
            factor = (weighted * y).sum() / (weighted * x).sum()
        assert fit_color_gain(scene, photo).log_factors[channel] == np.log(factor)
