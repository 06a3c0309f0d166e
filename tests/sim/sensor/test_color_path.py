"""Effects on the color path against their laws, and exact bytes without them."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.images import srgb_from_linear
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.sensor.color import PIXEL_EFFECTS
from digs_warp.sim.sensor.color.adaptation import Adaptation
from digs_warp.sim.sensor.color.encoding import decode, encode
from digs_warp.sim.sensor.color.image_noise import (
    ReadNoise,
    ShotNoise,
    read_sigma,
    shot_factor,
)
from digs_warp.sim.sensor.color.protocol import EyeImages, PixelEffect
from digs_warp.sim.sensor.color.vignetting import LensBlur, Vignetting

RIG = load_profile("zed2-720").rig(320, 180)
GREY = 0.18


def eyes(left: float | np.ndarray, right: float | np.ndarray | None = None) -> EyeImages:
    k = RIG.intrinsics
    shape = (k.height, k.width, 3)
    pair = (left, left if right is None else right)
    both = [np.broadcast_to(np.float32(value), shape).copy() for value in pair]
    return EyeImages(k, both[0], both[1])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_every_eight_bit_value_survives_linear_light() -> None:
    values = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(encode(decode(values)), values)
    steps = np.linspace(0, 1, 65536)
    np.testing.assert_array_equal(encode(steps - 0.3 / 65535), encode(steps))


@pytest.mark.parametrize("noise", [1.0, 2.0, 4.0])
def test_both_noises_make_what_the_rig_states_at_middle_gray(noise: float) -> None:
    rig = replace(RIG, image_noise=noise)
    noisy = ReadNoise().apply(ShotNoise().apply(eyes(GREY), rig, rng(1)), rig, rng(2))
    for image in (noisy.left, noisy.right):
        steps = 255 * srgb_from_linear(image.astype(np.float64))
        assert steps.std() == pytest.approx(noise, rel=0.05)
        assert steps.mean() == pytest.approx(
            255 * srgb_from_linear(np.array(GREY)), abs=0.2
        )  # the curve of sRGB bends


def test_shot_noise_grows_with_the_root_of_light_and_read_noise_does_not() -> None:
    levels = (0.02, 0.08, 0.32, 0.9)
    shot = [np.var(ShotNoise().apply(eyes(x), RIG, rng(3)).left - np.float32(x)) for x in levels]
    np.testing.assert_allclose(shot, shot_factor(RIG) ** 2 * np.array(levels), rtol=0.02)
    read = [np.std(ReadNoise().apply(eyes(x), RIG, rng(3)).left - np.float32(x)) for x in levels]
    np.testing.assert_allclose(read, read_sigma(RIG), rtol=0.01)


def test_noise_is_white_and_independent_between_eyes() -> None:
    for effect in (ShotNoise(), ReadNoise()):
        noisy = effect.apply(eyes(GREY), RIG, rng(4))
        left, right = noisy.left[..., 0] - GREY, noisy.right[..., 0] - GREY
        assert abs(np.corrcoef(left.ravel(), right.ravel())[0, 1]) < 0.02
        assert abs(np.corrcoef(left[:, 1:].ravel(), left[:, :-1].ravel())[0, 1]) < 0.02
        assert abs(np.corrcoef(left.ravel(), noisy.left[..., 1].ravel())[0, 1]) < 0.02


def test_vignetting_takes_what_the_rig_states_from_the_corners_and_nothing_from_the_middle() -> (
    None
):
    rig = replace(RIG, vignetting=0.4)
    shaded = Vignetting().apply(eyes(0.5, 0.25), rig, rng())
    left = shaded.left[..., 0]
    assert left[0, 0] == pytest.approx(0.5 * 0.6, rel=1e-5)
    assert left[90, 160] == pytest.approx(0.5, rel=1e-3)
    np.testing.assert_allclose(shaded.right, 0.5 * shaded.left, rtol=1e-6)
    along = left[90, 160:]
    assert (np.diff(along) < 0).all()
    # cos^4 between the middle and the corner.
    k = rig.intrinsics
    cos4 = [
        (1 + ((x - k.cx) ** 2 + (y - k.cy) ** 2) / k.fx**2) ** -2
        for x, y in [(250.5, 90.5), (0.5, 0.5)]
    ]
    assert 1 - left[90, 250] / 0.5 == pytest.approx(0.4 * (1 - cos4[0]) / (1 - cos4[1]), rel=1e-3)


@pytest.mark.parametrize("sigma", [0.6, 0.75, 1.1])
def test_the_lens_passes_the_stated_share_of_fine_contrast(sigma: float) -> None:
    """At a quarter of a cycle per pixel, along rows; plain areas keep their light."""
    wave = 0.5 + 0.4 * np.cos(np.pi / 2 * np.arange(320))
    images = eyes(np.broadcast_to(wave[None, :, None], (180, 320, 3)))
    blurred = LensBlur().apply(images, replace(RIG, lens_blur=sigma), rng())
    contrast = np.ptp(blurred.left[90, 40:280, 1]) / np.ptp(images.left[90, 40:280, 1])
    assert contrast == pytest.approx(np.exp(-2 * (np.pi * sigma / 4) ** 2), rel=0.03)
    assert blurred.left[20:160, 40:280].mean() == pytest.approx(0.5, abs=1e-4)
    np.testing.assert_array_equal(blurred.left, blurred.right)


@pytest.mark.parametrize("effect", PIXEL_EFFECTS, ids=lambda effect: effect.name)
def test_strength_zero_is_no_effect_and_the_seed_decides(effect: PixelEffect) -> None:
    adapted = Adaptation(0.5, 0.4, -0.3)
    images = replace(eyes(rng(7).uniform(0, 1, (180, 320, 3))), adaptation=adapted)
    untouched = effect.apply(images, RIG, rng(), strength=0.0)
    np.testing.assert_allclose(untouched.left, images.left, rtol=1e-6)
    once, again = (effect.apply(images, RIG, rng(8)) for _ in range(2))
    np.testing.assert_array_equal(once.right, again.right)
