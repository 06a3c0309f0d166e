"""Recordings with the planned sensor, also of an infrared pair: on disk, in memory, as a stream."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.images import read_image
from digs_warp.data.layers import INFRARED_LAYERS, Layer
from digs_warp.data.rig import InfraredPair, Rig
from digs_warp.device import parallel
from digs_warp.record.files import read_json
from digs_warp.sim.camera.shutter import Shutter
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker, layers_of
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import simulate, simulate_in_memory
from digs_warp.sim.record.sensor_plan import make_plan, plan_for_facts
from digs_warp.sim.record.session import Session, prepare_session
from digs_warp.sim.record.stream import stream
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.sim.sensor.frame import Cause
from digs_warp.sim.sensor.matcher import match, search_range
from reference.file_hashes import file_hashes

CONFIG = SimulateConfig(
    profile="bare-matcher", frames=3, width=80, samples_per_pixel=1, labels="normals", seed=5
)


@pytest.fixture(scope="module")
def session() -> Session:
    return prepare_session(CONFIG, load_inputs(CONFIG))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("planned") / "capture"
    simulate(CONFIG, folder)
    return folder


def test_depth_cause_and_confidence_agree(recording: Path) -> None:
    capture = read_capture(recording)
    assert capture.about.cause_labels is not None
    assert capture.about.cause_labels[int(Cause.OCCLUDED)] == "occluded"
    for frame in capture.frames:
        coded = read_image(frame.path(Layer.DEPTH))[..., 0]
        cause, confidence = frame.load_cause(), frame.load_confidence()
        missing = ~np.isfinite(coded)
        assert 0.01 < missing.mean() < 0.5
        assert (cause[missing] != Cause.OK).all()
        assert (confidence[missing] == 0).all() and (confidence[~missing] > 0).all()
        np.testing.assert_array_equal(np.isneginf(coded), missing & (cause == Cause.NEAR))
        np.testing.assert_array_equal(np.isposinf(coded), missing & (cause == Cause.FAR))
        np.testing.assert_array_equal(np.isnan(frame.load_depth()), missing)
        np.testing.assert_allclose(np.linalg.norm(frame.load(Layer.NORMALS), axis=-1), 1, atol=1e-5)


def test_the_plan_is_kept_with_the_recording(recording: Path, session: Session) -> None:
    plan = read_json(recording / "sensor_plan.json", "plan")
    made = make_plan(session)
    assert [c["effect"] for c in plan["depth"] if c["on"]] == [c.effect for c in made.depth if c.on]
    assert read_capture(recording).about.effects == tuple(made.effects_on)
    figures = read_json(recording / "run.json", "record")["results"]["profile"]["figures"]
    assert figures["baseline"] == {"value": 0.12, "origin": "vendor", "note": "data sheet"}
    assert {figure["origin"] for figure in figures.values()} == {"measured", "vendor", "tuned"}


@pytest.mark.parametrize(
    ("effects", "readout_time"), [("rolling-shutter", 2 * 0.0184), ("none", 0)]
)
def test_a_recording_tells_how_long_its_rows_take(
    tmp_path: Path, effects: str, readout_time: float
) -> None:
    capture = simulate(replace(CONFIG, frames=1, effects=effects, strength=2.0), tmp_path / "out")
    assert capture.readout_time == pytest.approx(readout_time)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"labels": "all", "effects": "all"},
        {"profile": "d435"},
    ],
    ids=lambda changes: ",".join(changes) or "usual",
)
def test_what_was_cut_off_resumes_to_the_same_bytes_with_any_number_of_threads(
    changes: dict[str, Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    config = replace(CONFIG, frames=2, **changes)
    folder = tmp_path / "capture"
    simulate(config, folder)
    expected, before = file_hashes(folder), read_json(folder / "run.json", "record")["seconds"]
    simulate(config, folder, resume=True)
    assert read_json(folder / "run.json", "record")["seconds"] == before  # nothing was left to do
    gone = [path for path in folder.glob("*/0001.*") if path.parent.name != "images"]
    for path in (*gone, folder / "transforms.json", folder / "sensor_plan.json"):
        path.unlink()
    (folder / "depth/.0001.exr.4711.tmp").write_bytes(b"left by a process that was killed")
    kept = (folder / "images/0000.png").stat().st_mtime_ns
    monkeypatch.setattr(parallel, "default_threads", lambda: 1)
    simulate(config, folder, resume=True)
    assert "files are missing and made again: cause/0001.png" in caplog.text
    assert file_hashes(folder) == expected
    assert (folder / "images/0000.png").stat().st_mtime_ns == kept
    after = read_json(folder / "run.json", "record")["seconds"]
    assert all(after[stage] >= before[stage] for stage in before)


@pytest.mark.parametrize("tier", ["guided", "matcher"])
def test_at_strength_zero_every_tier_is_perfect(tier: Literal["guided", "matcher"]) -> None:
    small = replace(CONFIG, frames=1, labels="none")
    (perfect,) = simulate_in_memory(replace(small, tier="truth")).frames
    (weakest,) = simulate_in_memory(replace(small, tier=tier, strength=0.0)).frames
    for layer in (Layer.IMAGE, Layer.RIGHT, Layer.DEPTH):
        np.testing.assert_array_equal(perfect.load(layer), weakest.load(layer))
    assert (weakest.load_cause() == Cause.OK).all()


def test_effects_on_depth_leave_the_images_alone(tmp_path: Path) -> None:
    small = replace(CONFIG, frames=1)
    (perfect,) = simulate(replace(small, effects="none"), tmp_path / "none").frames
    (depth_only,) = simulate(replace(small, effects="static-field"), tmp_path / "depth").frames
    (image_only,) = simulate(replace(small, effects="shot-noise"), tmp_path / "image").frames
    np.testing.assert_array_equal(depth_only.load_image(), perfect.load_image())
    assert not np.array_equal(depth_only.load_depth(), perfect.load_depth())
    assert not np.array_equal(image_only.load_image(), perfect.load_image())
    assert not np.array_equal(image_only.load_depth(), perfect.load_depth())


def test_a_full_search_is_not_told_of_second_surfaces(session: Session) -> None:
    facts = make_plan(session).facts
    assert facts is not None
    plan = plan_for_facts(facts, session.rig, replace(CONFIG, tier="matcher", effects="all"))
    assert all(choice.on for choice in (*plan.color, *plan.depth))
    assert {choice.effect for choice in plan.depth}.isdisjoint({"transparency", "mirror"})


def test_the_matcher_matches_the_images_that_are_recorded(tmp_path: Path) -> None:
    config = replace(CONFIG, tier="matcher", frames=1, effects="shot-noise,read-noise")
    capture = simulate(config, tmp_path)
    (frame,) = capture.frames
    rig = prepare_session(config, load_inputs(config)).rig
    left, right = (gray_of(image) for image in (frame.load_image(), frame.load_right_image()))
    with np.errstate(divide="ignore"):
        again = rig.focal_baseline / match(left, right, search_range(rig), rig.window)
    depth, again = frame.load_depth(), again.astype(np.float32)
    known = np.isfinite(depth)
    assert known.mean() > 0.3
    np.testing.assert_allclose(depth[known], again[known], rtol=1e-6)
    inside = (again >= rig.min_depth) & (again <= rig.max_depth)
    np.testing.assert_array_equal(known, inside)


def test_unusable_settings_do_not_claim_the_folder(tmp_path: Path) -> None:
    zero = tmp_path / "zero.yaml"
    zero.write_text("figures: {baseline: {value: 0, origin: tuned}}")
    for wrong, words in (
        ({"effects": "fog"}, "fog"),
        ({"profile": "kinect"}, "kinect"),
        ({"profile": zero}, r"baseline \[m\]: 0"),
        ({"mesh": tmp_path / "none.glb"}, "no such file"),
        ({"environment": tmp_path / "none.hdr"}, "no such file"),
    ):
        with pytest.raises(DigsError, match=words):
            simulate(replace(CONFIG, **wrong), tmp_path / "capture")  # pyright: ignore
    assert not (tmp_path / "capture").exists()


D435 = SimulateConfig(
    profile="d435", frames=3, width=160, samples_per_pixel=1, tier="guided", seed=5
)


@pytest.fixture(scope="module")
def of_pair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("infrared") / "capture"
    simulate(D435, folder)
    return folder


def test_images_depth_and_mask_are_the_color_cameras(of_pair: Path) -> None:
    capture = read_capture(of_pair)
    rig = FrameMaker.of(D435).session.rig
    k = rig.image_intrinsics
    assert k.fx == pytest.approx(1.444 * rig.intrinsics.fx)
    for frame in capture.frames:
        assert frame.camera.intrinsics == k
        assert not frame.has(Layer.RIGHT)
        on_object = frame.load_mask() == 255
        error = frame.load_depth() - frame.load_depth_true()
        known = np.isfinite(error)
        assert known.mean() > 0.85
        disparity = rig.focal_baseline * np.abs(error) / frame.load_depth_true() ** 2
        assert np.median(disparity[known & on_object]) < 0.5
        # Mask and true depth belong together; at the rim, one ray decides on either.
        assert np.mean(frame.load_depth_true()[on_object] < 1.5) > 0.95


def test_readers_know_where_the_pair_is_and_do_not_take_it_for_a_right_image(
    of_pair: Path,
) -> None:
    capture = read_capture(of_pair)
    k = FrameMaker.of(D435).session.rig.intrinsics
    assert capture.rig == Rig(0.05, InfraredPair(0.015, k.fx, k.fy, k.cx, k.cy))
    assert capture.right_offset is None
    with pytest.raises(CaptureError, match="has no 'right_file_path'"):
        capture.frames[0].load_right_image()
    left, right = capture.frames[0].load_infrared()
    assert left.shape == right.shape == (k.height, k.width) and left.dtype == np.uint8
    assert (left != right).mean() > 0.5


def test_the_pair_shows_the_scene_at_the_stated_place(of_pair: Path) -> None:
    frame = read_capture(of_pair).frames[0]
    maker = FrameMaker.of(D435)
    truth, _ = maker.session.truth(0, Shutter(), projects=maker.plan.projects)
    left, right = frame.load_infrared()
    for infrared, eye in ((left, truth.image), (right, truth.right)):
        inside = gray_of(eye).astype(float)
        assert np.corrcoef(infrared.ravel(), inside.ravel())[0, 1] > 0.95
    place = frame.camera.cam_from_world @ np.append(truth.camera.center_world, 1)
    np.testing.assert_allclose(place[:3], [0.015, 0, 0], atol=1e-12)


def test_without_the_projector_only_the_pair_and_its_depth_change(
    tmp_path: Path, of_pair: Path
) -> None:
    on = read_capture(of_pair)
    names = [name for name in on.about.effects or () if name != "projector"]
    simulate(replace(D435, effects=",".join(names)), tmp_path)
    off = read_capture(tmp_path)
    for lit, dark in zip(on.frames, off.frames, strict=True):
        for layer in INFRARED_LAYERS:
            same = lit.path(layer).read_bytes() == dark.path(layer).read_bytes()
            pair = (Layer.INFRARED_LEFT, Layer.INFRARED_RIGHT, Layer.DEPTH)
            assert same == (layer not in pair), layer


def test_noise_of_the_color_image_is_not_that_of_the_left_eye() -> None:
    maker = FrameMaker.of(replace(D435, frames=1, effects="shot-noise,read-noise", strength=3.0))
    rendered = maker.render(0)
    recorded = maker.finish(rendered, {})
    assert rendered.color is not None and recorded.infrared_left is not None
    left = recorded.infrared_left.astype(float) - rendered.truth.image[..., 0]
    color = recorded.image.astype(float) - rendered.color.image
    for channel in np.moveaxis(color, -1, 0):
        assert abs(np.corrcoef(left.ravel(), channel.ravel())[0, 1]) < 0.05


def test_perfect_depth_is_the_color_cameras_own() -> None:
    config = replace(D435, tier="truth", frames=1)
    (frame,) = simulate_in_memory(config).frames
    assert set(layers_of(config, 0)) == set(frame.layers)
    np.testing.assert_array_equal(frame.load_depth(), frame.load_depth_true())


def test_a_stream_has_the_pair() -> None:
    frame = next(stream(replace(D435, frames=1)))
    assert frame.right is None and frame.infrared is not None
    assert frame.infrared[0].shape == frame.depth.shape == frame.left.shape[:2]


CONFIGS = (
    SimulateConfig(profile="bare-matcher", frames=2, width=64, labels="all"),
    SimulateConfig(profile="bare-matcher", frames=2, width=64, tier="truth"),
)


@pytest.fixture(scope="module", params=CONFIGS, ids=lambda config: config.tier)
def config(request: pytest.FixtureRequest) -> SimulateConfig:
    return request.param


@pytest.fixture(scope="module")
def stored(config: SimulateConfig, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return simulate(config, tmp_path_factory.mktemp("recording") / "capture")


def test_memory_holds_what_the_folder_holds(config: SimulateConfig, stored: Capture) -> None:
    capture = simulate_in_memory(config)
    assert (capture.rig, capture.about, len(capture)) == (stored.rig, stored.about, len(stored))
    for here, there in zip(capture.frames, stored.frames, strict=True):
        assert (here.name, here.time) == (there.name, there.time)
        assert here.camera.intrinsics == there.camera.intrinsics
        np.testing.assert_array_equal(here.camera.world_from_cam, there.camera.world_from_cam)
        assert here.layers.keys() == there.layers.keys()
        for layer in here.layers:
            pixels, expected = here.load(layer), there.load(layer)
            assert pixels.dtype == expected.dtype
            np.testing.assert_array_equal(pixels, expected)


def test_the_stream_gives_the_same_frames(config: SimulateConfig, stored: Capture) -> None:
    for frame, there in zip(stream(config), stored.frames, strict=True):
        assert f"{frame.number:04d}" == there.name and frame.time == there.time
        np.testing.assert_array_equal(frame.camera.world_from_cam, there.camera.world_from_cam)
        np.testing.assert_array_equal(frame.left, there.load_image())
        np.testing.assert_array_equal(frame.right, there.load_right_image())
        np.testing.assert_array_equal(frame.depth, there.load_depth())
        np.testing.assert_array_equal(frame.depth_true, there.load_depth_true())
        np.testing.assert_array_equal(frame.mask, there.load_mask())
        assert (frame.cause is not None) == there.has(Layer.CAUSE)
        if frame.cause is not None:
            np.testing.assert_array_equal(frame.cause, there.load_cause())


def test_a_capture_in_memory_has_no_folder() -> None:
    capture = Capture(None, (), None)
    assert str(capture) == "capture in memory"
    with pytest.raises(CaptureError, match="in memory: this needs a capture folder"):
        _ = capture.folder
