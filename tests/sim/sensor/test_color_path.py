"""Effects on the images: noise, lenses, exposure and white balance, against their laws."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.camera.metering import MOMENTS, meter_walk
from digs_warp.sim.camera.profiles import load_profile
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import simulate, simulate_in_memory
from digs_warp.sim.record.sensor_plan import SensorPlan, make_plan
from digs_warp.sim.record.session import Session, prepare_session
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.views import CameraTrack
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Material
from digs_warp.sim.sensor.color import AUTO_EXPOSURE, PIXEL_EFFECTS, WHITE_BALANCE
from digs_warp.sim.sensor.color.adaptation import (
    MAX_EXPOSURE,
    MAX_TINT,
    NOT_ADAPTED,
    Adaptation,
    AdaptationTrack,
    targets,
)
from digs_warp.sim.sensor.color.encoding import decode, encode
from digs_warp.sim.sensor.color.image_noise import (
    ReadNoise,
    ShotNoise,
    read_sigma,
    shot_factor,
)
from digs_warp.sim.sensor.color.protocol import EyeImages, PixelEffect
from digs_warp.sim.sensor.color.recorded import recorded_images
from digs_warp.sim.sensor.color.vignetting import LensBlur, Vignetting
from digs_warp.sim.sensor.facts import measure_facts
from digs_warp.sim.sensor.frame import FrameTruth
from digs_warp.sim.sensor.highlights import Highlights
from reference.plates import plate
from reference.stereo_frames import flat, make_frame, make_rig

RIG = replace(
    load_profile("zed2-720").rig(320, 180),
    exposure_lag=0.4,
    white_balance_lag=1.5,
    white_balance=0.6,
)
GREY = 0.18


def eyes(
    left: float | np.ndarray,
    right: float | np.ndarray | None = None,
    adapted: Adaptation = NOT_ADAPTED,
) -> EyeImages:
    k = RIG.intrinsics
    shape = (k.height, k.width, 3)
    pair = (left, left if right is None else right)
    both = [np.broadcast_to(np.float32(value), shape).copy() for value in pair]
    return EyeImages(k, both[0], both[1], adapted)


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
    images = eyes(rng(7).uniform(0, 1, (180, 320, 3)), adapted=adapted)
    untouched = effect.apply(images, RIG, rng(), strength=0.0)
    np.testing.assert_allclose(untouched.left, images.left, rtol=1e-6)
    once, again = (effect.apply(images, RIG, rng(8)) for _ in range(2))
    np.testing.assert_array_equal(once.right, again.right)


CONFIG = SimulateConfig(
    profile="bare-matcher", frames=3, width=80, samples_per_pixel=1, seed=2, tier="guided",
    effects="auto-exposure,white-balance",
)  # fmt: skip


@pytest.fixture(scope="module")
def session() -> Session:
    return prepare_session(CONFIG, load_inputs(CONFIG))


@pytest.fixture(scope="module")
def capture(session: Session, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """A recording of CONFIG; read-only."""
    return simulate(CONFIG, tmp_path_factory.mktemp("recorded") / "capture", session=session)


def stepped(before: list[float], after: list[float]) -> AdaptationTrack:
    """A light that jumps after two seconds."""
    times = np.array([0.0, 2.0, 2.0 + 1e-9, 4.5, 9.0])
    colors = np.array([before, before, after, after, after])
    return AdaptationTrack.following(times, targets(colors, RIG), RIG)


@pytest.mark.parametrize("after", [0.1, 1.0, 2.499, 6.0])
def test_a_step_of_light_is_followed_exponentially(after: float) -> None:
    """Exposure by one stop; white balance by the stated share, with its own lag."""
    track = stepped([0.18] * 3, [0.36] * 3)
    assert track.at(1.999).exposure == pytest.approx(0, abs=1e-6)
    assert track.at(2 + after).exposure == pytest.approx(-1 + np.exp(-after / 0.4), abs=1e-6)
    adapted = stepped([0.18] * 3, [0.36, 0.18, 0.09]).at(2 + after)
    reached = 0.6 * (1 - np.exp(-after / 1.5))
    assert (adapted.red, adapted.blue) == pytest.approx((-reached, reached), abs=1e-6)
    quick = replace(RIG, exposure_lag=0.0)
    at_once = AdaptationTrack.following(np.arange(2.0), np.eye(2, 3), quick)
    assert at_once.at(0.25).exposure == pytest.approx(0.75)


def test_the_course_between_moments_solves_the_differential_equation() -> None:
    """Against small Euler steps over random targets."""
    times = np.array([0.0, 0.3, 1.1, 1.2, 2.7, 4.0])
    aims = rng(4).uniform(-1, 1, (6, 3))
    track = AdaptationTrack.following(times, aims, RIG)
    lags, settings, step = np.array([0.4, 1.5, 1.5]), aims[0].copy(), 1e-4
    for n in range(40_000):
        if n % 7919 == 0:
            adapted = track.at(n * step)
            found = [adapted.exposure, adapted.red, adapted.blue]
            np.testing.assert_allclose(found, settings, atol=3e-4)
        aim = [np.interp(n * step, times, aims[:, i]) for i in range(3)]
        settings += step * (aim - settings) / lags


def test_settings_have_limits_also_when_scaled() -> None:
    (dark, bright), (red, blue) = (
        targets(np.array(colors), RIG)
        for colors in ([[0.0] * 3, [0.9] * 3], [[9, 1, 1], [1, 1, 9]])
    )
    assert dark.tolist() == [MAX_EXPOSURE, 0, 0] and bright[0] == -MAX_EXPOSURE
    assert red[1:].tolist() == [-MAX_TINT, 0] and blue[1:].tolist() == [0, -MAX_TINT]
    assert Adaptation(-1.0, 0.9, 0.1).scaled(4.0) == Adaptation(-MAX_EXPOSURE, MAX_TINT, 0.4)
    assert Adaptation(-1.0, 0.9, 0.1).scaled(0.0) == NOT_ADAPTED


@pytest.mark.parametrize("share", [0.0, 0.6, 1.0])
def test_a_color_cast_is_reduced_by_the_stated_share(share: float) -> None:
    rig = replace(RIG, white_balance=share)
    cast = np.array([0.3, 0.2, 0.14])
    settled = Adaptation(*targets(cast[None], rig)[0].tolist())
    balanced = WHITE_BALANCE.apply(eyes(cast, adapted=settled), rig, rng())
    for image in (balanced.left, balanced.right):
        left_over = np.log2(image[3, 5] / image[3, 5, 1])
        np.testing.assert_allclose(left_over, (1 - share) * np.log2(cast / cast[1]), atol=1e-5)
        np.testing.assert_allclose(image[..., 1], 0.2, rtol=1e-6)


def test_white_stays_white_and_nothing_exceeds_it() -> None:
    image = np.full((180, 320, 3), 0.7, np.float32)
    image[:9] = 1.0
    for adapted in (Adaptation(-1.0, -0.5, 0.5), Adaptation(1.0, 0.5, 0.5)):
        for effect in (AUTO_EXPOSURE, WHITE_BALANCE):
            result = effect.apply(eyes(image, adapted=adapted), RIG, rng())
            assert (result.left[:9] == 1).all() and result.left.max() <= 1


def test_exposure_time_comes_first_and_amplifies_no_noise() -> None:
    rig = replace(RIG, exposure_headroom=0.5)
    for exposure, longer, electronic in ((-1.0, 0.5, 1.0), (0.4, 2**0.4, 1.0), (1.5, 2**0.5, 2.0)):
        adapted = Adaptation(exposure)
        assert adapted.longer_exposure(rig) == pytest.approx(longer)
        exposed = AUTO_EXPOSURE.apply(eyes(0.1, adapted=adapted), rig, rng())
        np.testing.assert_allclose(exposed.electronic_gain, electronic)
        assert exposed.left[0, 0, 0] == pytest.approx(0.1 * longer * electronic)


def test_an_electronic_gain_multiplies_the_noise_of_the_darker_image() -> None:
    """Noise after the gain is the gain times the noise before it, for each channel of each eye."""
    rig = replace(load_profile("zed2-720").rig(640, 360), exposure_headroom=0.0)
    adapted = Adaptation(1.0, 0.6, -0.4)
    gains = np.array([2 * 2**0.6, 2.0, 2 * 2**-0.4])
    image = np.full((360, 640, 3), 0.1, np.float32)
    pair = EyeImages(rig.intrinsics, image, image.copy(), adapted)
    amplified = WHITE_BALANCE.apply(AUTO_EXPOSURE.apply(pair, rig, rng()), rig, rng())
    for effect, before in (
        (ShotNoise(), shot_factor(rig) * 0.1**0.5),
        (ReadNoise(), read_sigma(rig)),
    ):
        noisy = effect.apply(amplified, rig, rng(5))
        for eye, clean in ((noisy.left, amplified.left), (noisy.right, amplified.right)):
            spread = (eye - clean).std(axis=(0, 1))
            np.testing.assert_allclose(spread, gains * before, rtol=0.01)


def test_rules_look_at_clipped_pixels_and_at_the_color_cast() -> None:
    quiet = measure_facts([make_frame(25.0, rig=RIG, image=flat((180, 320)))], RIG)
    assert quiet.color_cast == pytest.approx(0, abs=1e-6)
    for saturated, dark, on in ((0.04, 0.04, False), (0.15, 0.0, True), (0.0, 0.15, True)):
        facts = replace(quiet, saturated_share=saturated, dark_share=dark)
        assert AUTO_EXPOSURE.choose(facts, RIG).on == on
    for cast, on in ((0.3, False), (0.5, True)):
        assert WHITE_BALANCE.choose(replace(quiet, color_cast=cast), RIG).on == on
    fixed = replace(RIG, white_balance=0.0)
    assert not WHITE_BALANCE.choose(replace(quiet, color_cast=2.0), fixed).on


def test_the_walk_is_metered_at_the_same_moments_however_many_frames_it_has(
    session: Session,
) -> None:
    few = meter_walk(session)
    many = meter_walk(replace(session, config=replace(CONFIG, frames=7)))
    shared = len(few.times)
    assert 0.6 * MOMENTS < shared < len(many.times) <= MOMENTS
    np.testing.assert_array_equal(few.settings, many.settings[:shared])
    assert few.times[-1] >= session.moments[-1]
    assert np.ptp(few.settings[:, 0]) > 0.3, "the walk goes from light to shade"
    # The meter sees what the frames show.
    frame = FrameMaker(session, SensorPlan()).render(1).truth
    colors = linear_from_srgb(frame.image / 255.0).mean(axis=(0, 1))
    i = int(np.argmin(np.abs(few.times - session.moments[1])))
    np.testing.assert_allclose(few.aims[i], targets(colors[None], session.rig)[0], atol=0.15)


def test_both_eyes_and_all_orders_get_the_same_gain_and_the_index_tells_it(
    session: Session, capture: Capture
) -> None:
    plan = make_plan(session)
    assert plan.effects_on == ("auto-exposure", "white-balance")
    maker = FrameMaker(session, plan)
    plain = FrameMaker(session, SensorPlan())
    for number in (2, 0):
        frame = capture.frames[number]
        gain = frame.color_gain
        assert gain == plan.color_gain(frame.time, 1.0) and gain is not None
        images = maker.finish(maker.render(number), {})
        np.testing.assert_array_equal(images.image, frame.load_image())
        truth = plain.render(number).truth
        assert images.right is not None
        for recorded, rendered in ((images.image, truth.image), (images.right, truth.right)):
            expected = np.minimum(linear_from_srgb(rendered / 255.0) * gain, 1)
            below = rendered < 250
            difference = np.abs(linear_from_srgb(recorded / 255.0) - expected)[below]
            assert difference.max() < 0.006  # half a step of 8 bits near white
    gains = [frame.color_gain for frame in capture.frames]
    assert len(set(gains)) == 3
    in_memory = simulate_in_memory(CONFIG)
    assert [frame.color_gain for frame in in_memory.frames] == gains


def test_an_infrared_pair_shares_the_exposure_and_has_no_white_balance() -> None:
    config = replace(CONFIG, profile="d435", width=96, seed=0)
    maker = FrameMaker.of(config)
    rendered = maker.render(1)
    assert rendered.color is not None
    images = maker.finish(rendered, {})
    gain = maker.plan.color_gain(maker.session.moments[1], 1.0)
    assert gain is not None and abs(np.log2(gain[0] / gain[1])) > 0.05
    truth = rendered.truth
    eyes = (images.infrared_left, truth.image), (images.infrared_right, truth.right)
    for recorded, before in (*eyes, (images.image, rendered.color.image)):
        assert recorded is not None
        factors = gain if recorded.ndim == 3 else gain[1]
        before = before if recorded.ndim == 3 else before[..., 0]
        expected = np.minimum(linear_from_srgb(before / 255.0) * factors, 1)
        difference = np.abs(linear_from_srgb(recorded / 255.0) - expected)[before < 250]
        assert difference.max() < 0.006


POSE = look_at(np.array([0.0, -2.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
SHORTER = Adaptation(exposure=-1.0)


def clipped(is_known: bool = True) -> FrameTruth:
    """Gray on the left, light of 1.6 on the right, which the image shows as white."""
    image = np.full((6, 8, 3), 100, np.uint8)
    image[:, 4:] = 255
    light = np.where(np.arange(48) % 8 < 4, 0.127, 1.6)[:, None] * np.ones(3)
    known = Highlights.of(image, light) if is_known else None
    truth = make_frame(25.0, make_rig(8, 6), image)
    return replace(truth, right=image, highlights=known, right_highlights=known)


@pytest.mark.parametrize(
    ("effects", "is_known", "expected"),
    [
        ((AUTO_EXPOSURE,), True, 0.8),
        ((AUTO_EXPOSURE,), False, 1.0),  # nobody knows how bright it was
        ((WHITE_BALANCE,), True, 1.0),  # the sensor has clipped it before
        ((AUTO_EXPOSURE, WHITE_BALANCE), True, 0.8),
    ],
)
def test_half_the_exposure_shows_light_up_to_twice_white(
    effects: tuple[PixelEffect, ...], is_known: bool, expected: float
) -> None:
    for recorded in recorded_images(clipped(is_known), effects, adaptation=SHORTER):
        assert (recorded[:, 4:] == encode(np.array([expected]))).all()
    exposed = recorded_images(clipped(), (AUTO_EXPOSURE,), adaptation=SHORTER)[0]
    assert (exposed[:, :4] == 71).all()  # half the light of 100


def test_a_renderer_keeps_the_light_that_its_image_clips() -> None:
    """A sky with a few spots that are twenty times as bright as the rest."""
    sky = np.ones((16, 32, 3), np.float32)
    sky[6:10, ::8] = (20.0, 20.0, 1.0)
    scene = plate((0, 0, 0), (0.1, 0, 0), (0, 0, 0.1), Material("gray", np.full(3, 0.2)))
    camera = Camera(Intrinsics.from_fov(64, 48, 90.0), POSE)
    renderer = RaycastRenderer(scene, Environment(sky, 20.0))
    image, _, highlights = renderer.photograph(CameraTrack.still(camera), samples=1)
    assert highlights is not None
    white = (image == 255).any(axis=2)
    assert 0.01 < white.mean() < 0.9
    assert np.array_equal(highlights.pixels, np.flatnonzero(white))
    assert np.array_equal(encode(highlights.light), image[white])
    assert highlights.light[:, 0].max() > 2.0 > 1.0 > highlights.light[:, 2].max()
