"""The exposure of each photograph is found in the training, and leaves the colors of the object alone."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from digs_warp.data.capture import Capture, Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import linear_from_srgb, srgb_from_linear, to_uint8
from digs_warp.data.layers import Layer
from digs_warp.measure.color_gain import ColorGain
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.evaluate import (
    Rendering,
    load_test_views,
    render_views,
    score_view,
    with_gain,
)
from digs_warp.train.exposure import Exposures, color_samples
from digs_warp.train.trainer import Trainer
from reference.tiny_capture import ball
from reference.trained_ball import trained

STEPS = 60


@pytest.fixture(scope="module")
def frames(capture: Capture) -> tuple[Frame, ...]:
    return capture.frames


@pytest.fixture(scope="module")
def stops() -> np.ndarray:
    """Gains of the frames [stops], with a mean of 0."""
    drawn = np.random.default_rng(3).uniform(-1, 1, (8, 3)) * [0.6, 0.5, 0.6] - 0.3
    return drawn - drawn.mean(axis=0)


def exposed(frame: Frame, stops: np.ndarray) -> Frame:
    light = linear_from_srgb(frame.load_image() / 255.0) * 2.0**stops
    return frame.with_layer(Layer.IMAGE, to_uint8(srgb_from_linear(light)))


def gray_ball() -> Gaussians:
    truth = ball()
    return replace(truth, sh=np.zeros_like(truth.sh))


def exposures_trained(frames: list[Frame], fit_exposure: Literal["on", "off"] = "on") -> Trainer:
    config = TrainConfig(
        stop=Stop(iterations=STEPS),
        learning_rate=4.0,  # there are few steps
        sh_degree=0,
        depth_weight=0.0,  # depth of a sphere; the photographs show splats on it, which reach farther
        fit_exposure=fit_exposure,
    )
    return trained(frames, config, gray_ball())


def quality(trainer: Trainer, frames: tuple[Frame, ...]) -> float:
    views = load_test_views(frames)
    scores = [*map(score_view, render_views(trainer.gaussians, views), views)]
    return float(np.mean([score.psnr_object for score in scores]))


def test_different_exposures_cost_little(frames: tuple[Frame, ...], stops: np.ndarray) -> None:
    changed = [exposed(frame, each) for frame, each in zip(frames, stops, strict=True)]
    with_fit, without = exposures_trained(changed), exposures_trained(changed, fit_exposure="off")
    assert with_fit.exposures is not None and without.exposures is None
    constant = quality(exposures_trained(list(frames), fit_exposure="off"), frames)
    assert quality(without, frames) < constant - 2.5
    assert quality(with_fit, frames) > constant - 1.0
    found = with_fit.exposures.log_factors * 2.4 / np.log(2)
    assert np.sqrt(((found - stops) ** 2).mean()) < 0.1


def test_nothing_is_fitted_where_the_exposure_is_known_to_be_constant() -> None:
    exposures = Exposures(3, constant=True)
    scene = np.random.default_rng(0).uniform(0.2, 0.8, (100, 3))
    for index in (0, 1, 2, 0):
        assert exposures.fit(index, scene, np.clip((0.5 + 0.3 * index) * scene, 0, 1)) is None
    assert exposures.rms_stops == 0.0


def test_the_gains_have_a_mean_of_zero() -> None:
    exposures = Exposures(5)
    rng = np.random.default_rng(0)
    scene = rng.uniform(0.2, 0.8, (100, 3))
    for index in (3, 1, 4, 3):
        exposures.fit(index, scene, np.clip(scene * rng.uniform(0.5, 1.2), 0, 1))
    assert exposures.fitted.tolist() == [False, True, False, True, True]
    np.testing.assert_allclose(exposures.log_factors.mean(axis=0), 0, atol=1e-12)
    np.testing.assert_array_equal(exposures.log_factors[[0, 2]], 0)


def test_black_white_and_constant_photographs_and_a_single_one(frames: tuple[Frame, ...]) -> None:
    def painted(frame: Frame, value: int) -> Frame:
        return frame.with_layer(Layer.IMAGE, np.full_like(frame.load_image(), value))

    hard = [painted(frame, value) for frame, value in zip(frames, (0, 255, 90), strict=False)]
    for views in ([*hard, *frames[3:]], hard, [frames[0]], [hard[0]]):
        trainer = exposures_trained(views)
        assert trainer.exposures is not None
        assert np.isfinite(trainer.exposures.log_factors).all()
        assert np.isfinite(trainer.gaussians.to_numpy().sh).all()


def test_a_gain_changes_the_gaussians_but_not_the_white_behind_them() -> None:
    gain = ColorGain(np.array([0.4, -0.3, 0.1]))
    covered = np.array([[[0.0], [0.4], [1.0]]], np.float32)
    images = [
        covered * color + 1 - covered for color in (np.full(3, 0.3), gain.applied(np.full(3, 0.3)))
    ]
    found = with_gain(Rendering(images[0].astype(np.float32), covered[..., 0]), gain)
    np.testing.assert_allclose(found, images[1], atol=1e-6)


def test_samples_are_inside_the_mask_and_few() -> None:
    image = np.random.default_rng(0).integers(0, 256, (200, 300, 3), dtype=np.uint8)
    mask = np.full((200, 300), 255, np.uint8)
    mask[:50] = 200
    samples = color_samples(image, mask)
    assert 2048 < len(samples.rows) <= 4096 and samples.rows.min() >= 50
    np.testing.assert_allclose(
        samples.values, image[samples.rows, samples.columns] / 255, atol=1e-6
    )
    assert len(color_samples(image, np.zeros_like(mask)).rows) == 0
