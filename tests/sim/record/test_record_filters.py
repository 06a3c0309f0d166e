"""Recording with the filters of the device and a confidence threshold."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.images import to_uint8
from digs_warp.device import parallel
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker, RenderedFrame
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.record import simulate
from digs_warp.sim.record.sensor_plan import make_plan
from digs_warp.sim.record.session import FRAME_RATE, Session, number_before, prepare_session
from digs_warp.sim.sensor.frame import Cause
from digs_warp.sim.sensor.post_filters.chain import COSTS, AfterMatching, choices_of
from digs_warp.sim.sensor.post_filters.names import FILTERS
from reference.file_hashes import file_hashes

CONFIG = SimulateConfig(profile="bare-matcher", frames=2, width=96, samples_per_pixel=1, seed=5)
ALL = "dense,spatial,temporal,hole-filling"


@pytest.fixture(scope="module")
def session() -> Session:
    return prepare_session(CONFIG, load_inputs(CONFIG))


@pytest.fixture(scope="module")
def maker_of(session: Session) -> Callable[..., FrameMaker]:
    """Makes frames with other settings of what comes after the scene."""
    plan = make_plan(session)

    def make(**changes: Any) -> FrameMaker:
        return FrameMaker(replace(session, config=replace(CONFIG, **changes)), plan)

    return make


@dataclass(frozen=True, eq=False)
class Finished:
    """What a frame maker wrote."""

    image: np.ndarray
    depth: np.ndarray
    cause: np.ndarray
    confidence: np.ndarray


def finished(maker: FrameMaker, rendered: RenderedFrame) -> Finished:
    """The finished frame, in which nothing is left out."""
    images = maker.finish(rendered, {})
    layers = images.image, images.depth, images.cause, images.confidence
    assert all(layer is not None for layer in layers)
    return Finished(*layers)  # pyright: ignore[reportArgumentType]


def test_frames_have_what_the_filters_make_of_the_matches(
    maker_of: Callable[..., FrameMaker],
) -> None:
    plain, filtered = (maker_of(filters=names) for names in ("none", "spatial,hole-filling"))
    rendered = filtered.render(1)
    before, after = (finished(maker, rendered) for maker in (plain, filtered))
    np.testing.assert_array_equal(before.image, after.image)
    missing, left = (~np.isfinite(frame.depth) for frame in (before, after))
    assert missing.any() and not (left & ~missing).any()
    assert left.sum() < missing.sum() / 4
    assert (after.cause[missing & ~left] == Cause.FILLED).all()
    assert (after.cause[left] == before.cause[left]).all()
    assert (before.depth != after.depth)[~missing].mean() > 0.5


def test_the_threshold_drops_what_is_below_and_nothing_else(
    maker_of: Callable[..., FrameMaker],
) -> None:
    plain, strict = maker_of(), maker_of(confidence_threshold=0.9)
    rendered = plain.render(1)
    before, after = (finished(maker, rendered) for maker in (plain, strict))
    known = np.isfinite(before.depth)
    kept = np.isfinite(after.depth)
    np.testing.assert_array_equal(after.depth[kept], before.depth[kept])
    limit = int(to_uint8(np.array(0.9, np.float32)))
    assert (before.confidence[kept] >= limit).all()
    assert (before.confidence[known & ~kept] <= limit).all() and (known & ~kept).any()
    assert (after.cause[known & ~kept] == Cause.LOW_CONFIDENCE).all()


def test_the_temporal_filter_looks_at_the_frames_just_before(
    session: Session, maker_of: Callable[..., FrameMaker]
) -> None:
    maker = maker_of(filters="temporal")
    rendered = maker.render(1)
    assert [truth.number for truth in rendered.earlier] == [number_before(1, n) for n in (3, 2, 1)]
    assert len({1, *(truth.number for truth in rendered.earlier)}) == 4
    for before, truth in zip((3, 2, 1), rendered.earlier, strict=True):
        pose = session.walk.pose(session.moments[1] - before / FRAME_RATE)
        np.testing.assert_array_equal(truth.camera.world_from_cam, pose)
    # Before the walk, the camera stands still.
    first = maker.render(0)
    for truth in first.earlier:
        np.testing.assert_array_equal(truth.depth, first.truth.depth)


def test_all_cameras_and_effects_bear_filters() -> None:
    """A D435 with its infrared pair, and an exposure that changes from frame to frame."""
    config = replace(CONFIG, frames=1, profile="d435", effects="all")
    plain = FrameMaker.of(config)
    filtered = replace(config, filters="temporal,hole-filling")
    makers = [FrameMaker(replace(plain.session, config=c), plain.plan) for c in (config, filtered)]
    depths = []
    for maker in makers:
        depth = maker.finish(maker.render(0), {}).depth
        assert depth is not None
        depths.append(depth)
    before, after = (np.isfinite(depth) for depth in depths)
    assert (after | ~before).all() and before.mean() > 0.5
    # Before its walk the camera stands still: what differs between the frames changes, and nothing else.
    maker, rendered = makers[1], makers[1].render(0)
    truths = (*rendered.earlier, rendered.truth)
    shots = [maker._shot(truth, maker._matched_pair(truth)) for truth in truths]
    *earlier, last = (shot.sensed.disparity for shot in shots)
    differs = np.any([np.isfinite(one) & (one != last) for one in earlier], axis=0)
    known = np.isfinite(last)
    changed = maker.device.apply(shots).disparity != last
    assert differs[known].mean() > 0.9, "speckle changes all"
    assert changed[known & differs].mean() > 0.99 and not changed[known & ~differs].any()
    # In the color camera's image, places of depth are slightly different.
    share = (depths[0] != depths[1])[before].mean()
    assert share == pytest.approx(differs[known].mean(), abs=0.03)


def test_every_filter_has_a_price() -> None:
    assert COSTS.keys() == FILTERS.keys()
    assert choices_of(AfterMatching()) == ()


def test_filters_change_nothing_of_the_truth(tmp_path: Path) -> None:
    config = replace(CONFIG, frames=1, strength=0.0)
    plain = simulate(config, tmp_path / "plain")
    filtered = replace(config, filters=ALL, confidence_threshold=0.9)
    assert FrameMaker.of(filtered).device == AfterMatching()
    found = simulate(filtered, tmp_path / "filtered")
    np.testing.assert_array_equal(found.frames[0].load_depth(), plain.frames[0].load_depth())


def test_filtered_depth_stays_in_range(maker_of: Callable[..., FrameMaker]) -> None:
    maker = maker_of(filters=ALL)
    images = finished(maker, maker.render(0))
    rig = maker.session.rig
    known = images.depth[np.isfinite(images.depth)]
    assert known.min() >= np.float32(rig.min_depth) and known.max() <= np.float32(rig.max_depth)
    missing = ~np.isfinite(images.depth)
    assert (images.cause[missing] != Cause.OK).all() and (images.confidence[missing] == 0).all()


def test_any_number_of_threads_and_a_resumed_run_give_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(CONFIG, filters=ALL, confidence_threshold=0.4)
    simulate(config, tmp_path / "many")
    monkeypatch.setattr(parallel, "default_threads", lambda: 1)
    simulate(config, tmp_path / "one")
    assert file_hashes(tmp_path / "one") == file_hashes(tmp_path / "many")
    shutil.copytree(tmp_path / "many", tmp_path / "again")
    for gone in ("transforms.json", "depth/0001.exr", "confidence/0000.png"):
        (tmp_path / "again" / gone).unlink()
    simulate(config, tmp_path / "again", resume=True)
    assert file_hashes(tmp_path / "again") == file_hashes(tmp_path / "many")


@pytest.mark.parametrize(
    ("tier", "setting", "value"),
    [("truth", "filters", "spatial"), ("law", "confidence_threshold", 0.5)],
)
def test_tiers_that_match_nothing_refuse_both(tier: Any, setting: str, value: Any) -> None:
    with pytest.raises(DigsError, match=rf"{setting} {value}: has no meaning with --tier {tier}"):
        SimulateConfig(tier=tier, **{setting: value})
    SimulateConfig(tier=tier, filters="none", confidence_threshold=0.0)


def test_wrong_values_are_refused_at_once() -> None:
    with pytest.raises(DigsError, match="--filters: no filter 'blur'"):
        SimulateConfig(filters="blur")
    for wrong in (-0.1, 1.1, float("nan")):
        with pytest.raises(DigsError, match=r"confidence_threshold: .*, expected 0 to 1"):
            SimulateConfig(confidence_threshold=wrong)
