"""Recording with the planned sensor: its layers and files, and the same bytes however it is run."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.device import parallel
from digs_warp.record.files import read_json
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import simulate
from digs_warp.sim.record.sensor_plan import make_plan, plan_for_facts
from digs_warp.sim.record.session import Session, prepare_session
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
    changes: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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
    monkeypatch.setattr(parallel, "default_threads", lambda: 1)
    simulate(config, folder, resume=True)
    assert file_hashes(folder) == expected
    after = read_json(folder / "run.json", "record")["seconds"]
    assert all(after[stage] >= before[stage] for stage in before)


def layers(capture: Capture) -> list[np.ndarray]:
    return [
        layer
        for frame in capture.frames
        for layer in (frame.load_image(), frame.load_right_image(), frame.load_depth())
    ]


@pytest.mark.parametrize("tier", ["guided", "matcher"])
def test_at_strength_zero_every_tier_is_perfect(
    tier: Literal["guided", "matcher"], tmp_path: Path
) -> None:
    small = replace(CONFIG, frames=1, labels="none")
    perfect = simulate(replace(small, tier="truth"), tmp_path / "truth")
    weakest = simulate(replace(small, tier=tier, strength=0.0), tmp_path / tier)
    for a, b in zip(layers(perfect), layers(weakest), strict=True):
        np.testing.assert_array_equal(a, b)
    assert (weakest.frames[0].load_cause() == Cause.OK).all()


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
    for wrong in ({"effects": "fog"}, {"profile": "kinect"}, {"profile": zero}):
        with pytest.raises(DigsError, match=r"fog|kinect|baseline \[m\]: 0"):
            simulate(replace(CONFIG, **wrong), tmp_path / "capture")  # pyright: ignore
    assert not (tmp_path / "capture").exists()
