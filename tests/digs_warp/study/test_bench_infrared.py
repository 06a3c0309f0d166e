"""The measurement of dots against known ones, and the simulated dots against a real camera's."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.images import srgb_from_linear
from digs_warp.study.bench_infrared import REAL_PAIR, compare_with_real
from digs_warp.study.dots import fit_plane, measure_dots


def spots(sigma: float, noise: float, background: float = 60.0) -> tuple[np.ndarray, int]:
    """An image of Gaussian spots [DN] on a jittered grid of 10 px, and their number."""
    rng = np.random.default_rng(2)
    y, x = np.mgrid[:200, :300]
    image = np.full((200, 300), background)
    places = [(r + rng.uniform(-1, 1), c + rng.uniform(-1, 1))
              for r in range(10, 200, 10) for c in range(10, 300, 10)]  # fmt: skip
    for row, column in places:
        away = (x - column) ** 2 + (y - row) ** 2
        image += 80 * np.exp(-away / (2 * sigma**2))
    image += noise * rng.standard_normal(image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), len(places)


@pytest.mark.parametrize("sigma", [0.9, 1.3])
@pytest.mark.parametrize("noise", [0.5, 1.5])
def test_spots_are_measured(sigma: float, noise: float) -> None:
    image, count = spots(sigma, noise)
    region = np.ones(image.shape, bool)
    found = measure_dots(image, region)
    assert found.area == pytest.approx(region.sum() / count, rel=0.02)
    assert found.sigma == pytest.approx(sigma, rel=0.04)
    top, bottom = srgb_from_linear_inverse(140.0), srgb_from_linear_inverse(60.0)
    assert found.brightness == pytest.approx(top - bottom, rel=0.06)
    assert found.spread < 0.06
    assert found.noise == pytest.approx(np.hypot(noise, 12**-0.5), rel=0.12)
    assert 0.8 < found.nearest < 0.95


def srgb_from_linear_inverse(value: float) -> float:
    """Linear light of an 8-bit value, by search in the curve of `srgb_from_linear`."""
    linear = np.linspace(0, 1, 100_001)
    return float(np.interp(value / 255, srgb_from_linear(linear), linear))


def test_a_plane_is_found_among_outliers_and_its_noise_is_measured() -> None:
    rng = np.random.default_rng(1)
    rows, columns = np.mgrid[:80, :120]
    noise = rng.standard_normal((80, 124))
    smooth = 0.2 * (noise[:, :-4] + noise[:, 1:-3] + noise[:, 2:-2] + noise[:, 3:-1]) / 2
    disparity = 20 + 0.05 * columns - 0.1 * rows + smooth
    region = np.zeros(disparity.shape, bool)
    region[10:70, 10:110] = True
    disparity[20:30, 20:60] += 7
    disparity[40:45, 40:80] = np.nan
    fit = fit_plane(disparity, region)
    assert fit.plane[0] == pytest.approx(20, abs=0.15)  # the outliers are all on one side
    np.testing.assert_allclose(fit.plane[1:], [0.05, -0.1], atol=2e-3)
    assert fit.fill == pytest.approx(1 - 200 / 6000) and fit.wrong == pytest.approx(400 / 5800)
    assert fit.rms == pytest.approx(0.2, rel=0.05)
    np.testing.assert_allclose(fit.correlation, [0.5, 0], atol=0.05)


def test_simulated_dots_are_like_those_of_a_real_pair(sample_data: Path) -> None:
    real, simulated = (result.values for result in compare_with_real(sample_data / REAL_PAIR))
    limits = {
        "px per dot": 0.08,
        "nearest dot / spacing": 0.04,
        "spot sigma [px]": 0.06,
        "brightness of a dot": 0.12,
        "spread of its logarithm": 0.25,
        "image noise [DN]": 0.15,
        "fill": 0.02,
        "RMS to the plane [px]": 0.25,
    }
    for name, limit in limits.items():
        assert simulated[name] == pytest.approx(real[name], rel=limit), name
