"""The check of a capture names what is wrong with it, and says nothing about a good one."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.check.check import check_capture
from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.show.report.facts import describe
from digs_warp.sim.config import SimulateConfig, Tier
from digs_warp.sim.record.frame_maker import FrameMaker, RenderedFrame
from digs_warp.sim.record.record import simulate_in_memory
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.tiers import depth_of, sense
from reference import wrong_captures as wrong
from reference.real_captures import recorded

CONFIG = SimulateConfig(frames=18, width=160, height=90)
EVERY_EFFECT = tuple(Choice(effect.name, True, "", "", "") for effect in EFFECTS)


@pytest.fixture(scope="module")
def rendered() -> list[RenderedFrame]:
    maker = FrameMaker.of(CONFIG)
    return [maker.render(number) for number in range(CONFIG.frame_count)]


def sensed(rendered: list[RenderedFrame], tier: Tier, strength: float = 1.0) -> Capture:
    """The built-in capture as a sensor measures it, with all effects of the device."""
    frames = []
    for number, frame in enumerate(rendered):
        truth = frame.truth
        depth = depth_of(sense(truth, tier, EVERY_EFFECT, strength=strength), truth)
        layers = {Layer.IMAGE: truth.image, Layer.DEPTH: depth, Layer.MASK: frame.objects.mask}
        frames.append(Frame(f"{number:04d}", truth.camera, float(number), layers))
    return Capture(None, tuple(frames), None)


def said(capture: Capture, **parts: bool) -> list[str]:
    """What the quick check finds."""
    return [str(each) for each in check_capture(capture, "info", **parts).findings]


@pytest.fixture(scope="module")
def good(rendered: list[RenderedFrame]) -> Capture:
    return sensed(rendered, "guided")


@pytest.mark.parametrize(
    ("tier", "strength"),
    [("truth", 0), ("law", 1), ("law", 2), ("guided", 1), ("guided", 2), ("matcher", 1)],
)
def test_good_captures_of_every_tier_have_no_finding(
    rendered: list[RenderedFrame], tier: Tier, strength: float
) -> None:
    found = check_capture(sensed(rendered, tier, strength), "info")
    assert found.findings == ()
    assert found.agreement is not None and found.agreement.score > 0.25


def test_a_rolling_shutter_at_twice_its_time_has_no_finding() -> None:
    shaken = replace(CONFIG, frames=12, effects="rolling-shutter,image-blur", strength=2.0)
    assert said(simulate_in_memory(shaken)) == []


WRONG: dict[str, tuple[Callable[[Capture], Capture], str]] = {
    "x1000": (lambda c: wrong.scaled_depth(c, 1000), "the depth is in millimetres"),
    "/5": (lambda c: wrong.scaled_depth(c, 0.2), "but was read in TUM's units, 5000 per metre"),
    "/1000": (lambda c: wrong.scaled_depth(c, 1e-3), "the poses are in millimetres"),
    "x100": (lambda c: wrong.scaled_depth(c, 100), "the depth is in centimetres"),
    "x10": (lambda c: wrong.scaled_depth(c, 10), "the depth is in tenths of its unit"),
    "/10": (lambda c: wrong.scaled_depth(c, 0.1), "the depth is 10 times too small"),
    "inches": (lambda c: wrong.scaled_depth(c, 1 / 0.0254), "the depth is in inches"),
    "unit of SfM": (lambda c: wrong.scaled_depth(c, 2.5), r"different units \(depth x 0.4 fits\)"),
    "focal x10": (lambda c: wrong.other_focal(c, 10), r"focal length \(about 0.1 times"),
    "focal x1.3": (lambda c: wrong.other_focal(c, 1.3), r"focal length \(about 0.77 times"),
    "focal x1.15": (lambda c: wrong.other_focal(c, 1.15), r"focal length \(about 0.87 times"),
    "focal x0.7": (lambda c: wrong.other_focal(c, 0.7), r"focal length \(about 1.43 times"),
    "OpenCV axes": (wrong.opencv_axes, "the poses have OpenCV camera axes"),
    "inverted": (wrong.inverted, r"the poses are inverted \(camera from world\)\. "),
    "inverted, OpenCV": (wrong.inverted_opencv, "are inverted .* and have OpenCV camera axes"),
    "late poses": (lambda c: wrong.poses_of(c, [0, *range(17)]), "those 1 frame.s. later fit"),
    "shuffled": (
        lambda c: wrong.poses_of(c, np.random.default_rng(1).permutation(18).tolist()),
        "images, depth and poses do not belong together|much better with the poses of other frames",
    ),
    "masks": (wrong.inverted_masks, "masks .* seem to be inverted"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named(good: Capture, name: str) -> None:
    spoil, cause = WRONG[name]
    (finding,) = said(spoil(good))
    assert re.search(cause, finding)


def test_depth_along_the_ray_is_named_where_the_sensor_is_precise(
    rendered: list[RenderedFrame],
) -> None:
    (finding,) = said(wrong.depth_along_rays(sensed(rendered, "truth")))
    assert "the distance along the ray" in finding


def test_depth_that_is_not_registered_is_named_where_the_sensor_is_precise(
    rendered: list[RenderedFrame],
) -> None:
    (finding,) = said(wrong.shifted_depth(sensed(rendered, "truth"), 6), poses=False)
    assert re.search(
        r"better if it is moved by 3\.\d% of the width to the left and 0\.\d%", finding
    )


@pytest.mark.parametrize("shape", [(1, 1), (1, 4000), (700, 1), (3, 5)])
def test_images_of_any_shape_can_be_checked(shape: tuple[int, int]) -> None:
    height, width = shape
    k = Intrinsics(width, height, 50.0, 50.0, width / 2, height / 2)
    layers = {
        Layer.IMAGE: np.zeros((height, width, 3), np.uint8),
        Layer.DEPTH: np.ones(shape, np.float32),
        Layer.MASK: np.full(shape, 255, np.uint8),
    }
    moves = [
        np.array([[1, 0, 0, 0.1 * n], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) for n in range(3)
    ]
    frames = tuple(Frame(str(n), Camera(k, move), float(n), layers) for n, move in enumerate(moves))
    assert said(Capture(None, frames, None)) == []


def test_info_prints_one_line(good: Capture, tmp_path: Path) -> None:
    writer = CaptureWriter(tmp_path, good.frames[0].camera.intrinsics)
    for number, frame in enumerate(good.frames):
        images = FrameImages(frame.load_image(), frame.load_depth(), frame.load_mask())
        writer.write_frame(number, images)
        writer.add_pose(number, frame.camera.world_from_cam, frame.time)
    writer.finish()
    assert re.fullmatch(
        r"\d+% between neighboring frames; no finding", describe(tmp_path)["agreement"]
    )
    index = json.loads((tmp_path / "transforms.json").read_text())
    index["fl_x"], index["fl_y"] = 10 * index["fl_x"], 10 * index["fl_y"]
    (tmp_path / "transforms.json").write_text(json.dumps(index))
    assert "about 0.1 times the given one fits" in describe(tmp_path)["findings"]


def test_without_poses_the_range_of_the_depth_and_the_masks_are_checked(good: Capture) -> None:
    lost = replace(good, about=replace(good.about, poses_known=False))
    assert said(lost) == []
    for factor in (1000, 1e-3):
        (finding,) = said(wrong.scaled_depth(lost, factor))
        assert "it seems to be in another unit" in finding
    assert len(said(wrong.inverted_masks(lost))) == 1


def test_what_is_not_used_is_not_checked(good: Capture) -> None:
    assert said(wrong.inverted(good), poses=False) == []
    assert said(wrong.inverted_masks(good), masks=False) == []


def test_captures_with_nothing_to_compare_are_left_alone(good: Capture) -> None:
    bare = wrong.each_frame(good, lambda f: replace(f, layers={Layer.IMAGE: f.layers[Layer.IMAGE]}))
    blind = wrong.scaled_depth(good, np.nan)
    for capture in (bare, blind):
        assert said(capture) == []
    for count in (1, 5):  # the same frame several times
        assert said(replace(good, frames=good.frames[:1] * count)) == []


@pytest.mark.parametrize("kind", ["hololens_room_sequence", "tum_cabinet_orbit"])
def test_real_recordings_have_no_finding_until_they_are_spoiled(
    sample_data: Path, kind: str
) -> None:
    capture = recorded(sample_data / "rgbd" / kind, kind)
    assert said(capture) == []
    for spoil, cause in (
        (lambda c: wrong.scaled_depth(c, 1000), "the depth is in millimetres"),
        (lambda c: wrong.other_focal(c, 2), "about 0.5 times the given one fits"),
        (wrong.opencv_axes, "the poses have OpenCV camera axes"),
        (lambda c: wrong.shifted_depth(c, 20), "depth and images do not have the same camera"),
    ):
        assert cause in " ".join(said(spoil(capture)))
