"""The check of a capture names what is wrong with it, and says nothing about a good one."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.check.check import check_capture
from digs_warp.check.evidence import Evidence
from digs_warp.check.findings import CHECKS, Finding, limit_of
from digs_warp.check.motion import moved_share
from digs_warp.check.outliers import REACH, Links, alone
from digs_warp.check.recording import median_exposure_change
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.images import read_image
from digs_warp.data.layers import Layer
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import matrix_from_rotation_vector
from digs_warp.masks.no_scene import without_no_scene
from digs_warp.poses.photo_matches import agreeing_shares
from digs_warp.poses.thresholds import USUAL_MATCH_SHARE
from digs_warp.show.report.facts import describe
from digs_warp.sim.camera.walk.settings import WalkSettings
from digs_warp.sim.config import SimulateConfig, Tier
from digs_warp.sim.record.frame_maker import FrameMaker, RenderedFrame
from digs_warp.sim.record.record import simulate_in_memory
from digs_warp.sim.sensor.effects import EFFECTS
from digs_warp.sim.sensor.effects.protocol import Choice
from digs_warp.sim.sensor.tiers import depth_of, sense
from reference import wrong_captures as wrong
from reference.real_captures import recorded
from reference.wrong_captures import each_frame, with_a_jump

MARGIN = 1.5  # between each limit and what is good or wrong
OTHER_ORDER = np.random.default_rng(1).permutation(18).tolist()
CONFIG = SimulateConfig(profile="bare-matcher", frames=18, width=160, height=90)
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
def good() -> Capture:
    return simulate_in_memory(replace(CONFIG, samples_per_pixel=2))


def share_that_moved(capture: Capture) -> float:
    evidence = Evidence(capture)
    return moved_share(evidence.frames, evidence.pairs)


def test_a_good_capture_has_no_finding(good: Capture) -> None:
    assert check_capture(good).findings == ()


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
    "x1000": (lambda c: wrong.scaled_depth(c, 1000), "depth unit: .* in millimetres"),
    "/5": (lambda c: wrong.scaled_depth(c, 0.2), "depth unit: .*TUM's units, 5000 per metre"),
    "/1000": (lambda c: wrong.scaled_depth(c, 1e-3), "depth unit: .*poses are in millimetres"),
    "x10": (lambda c: wrong.scaled_depth(c, 10), "depth unit: .*in tenths of its unit"),
    "inches": (lambda c: wrong.scaled_depth(c, 1 / 0.0254), "depth unit: .*in inches"),
    "unit of SfM": (lambda c: wrong.scaled_depth(c, 2.5), r"scale: .*\(depth x 0.4 fits\)"),
    "focal x10": (lambda c: wrong.other_focal(c, 10), r"focal length: .*about 0.1 times"),
    "focal x1.15": (lambda c: wrong.other_focal(c, 1.15), r"focal length: .*about 0.87 times"),
    "focal x0.7": (lambda c: wrong.other_focal(c, 0.7), r"focal length: .*about 1.43 times"),
    "OpenCV axes": (wrong.opencv_axes, "pose convention: .*have OpenCV camera axes"),
    "inverted": (wrong.inverted, r"pose convention: .*are inverted \(camera from world\)\. "),
    "inverted, OpenCV": (wrong.inverted_opencv, "pose convention: .*have OpenCV camera axes"),
    "late poses": (lambda c: wrong.poses_of(c, [0, *range(17)]), "those 1 frame.s. later fit"),
    "shuffled": (lambda c: wrong.poses_of(c, OTHER_ORDER), "order: |time stamps: "),
    "inverted masks": (wrong.inverted_masks, "masks inverted: "),
    "masks of a pixel": (lambda c: wrong.masks_of(c, 1), "masks empty: "),
    "masks of nothing": (lambda c: wrong.masks_of(c, 0), "masks empty: "),
    "exposure": (lambda c: wrong.other_exposures(c, 2.0), "exposure: "),
    "balls": (lambda c: wrong.with_passing_balls(c, 0.2), "moving things: "),
    "gripper": (wrong.with_gripper, "attached: 1.*--write-ignore-mask mask.png"),
    "3 views": (lambda c: replace(c, frames=c.frames[::6]), "few views: "),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_the_only_finding(good: Capture, name: str) -> None:
    spoil, cause = WRONG[name]
    (finding,) = check_capture(spoil(good)).findings
    assert re.search(cause, f"{finding.kind}: {finding}")


def test_what_only_a_precise_sensor_tells_is_named(rendered: list[RenderedFrame]) -> None:
    exact = sensed(rendered, "truth")
    (finding,) = said(wrong.depth_along_rays(exact))
    assert "the distance along the ray" in finding
    (finding,) = said(wrong.shifted_depth(exact, 6), poses=False)
    assert re.search(r"is moved by 3\.\d% of the width to the left and 0\.\d%", finding)


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


def written(capture: Capture, folder: Path) -> Path:
    writer = CaptureWriter(folder, capture.frames[0].camera.intrinsics)
    for number, frame in enumerate(capture.frames):
        images = FrameImages(frame.load_image(), frame.load_depth(), frame.load_mask())
        writer.write_frame(number, images)
        writer.add_pose(number, frame.camera.world_from_cam, frame.time)
    writer.finish()
    return folder


def test_info_prints_one_line(good: Capture, tmp_path: Path) -> None:
    said_of = describe(written(good, tmp_path / "good"))
    assert re.fullmatch(r"\d+% between neighboring frames; no finding", said_of["agreement"])
    said_of = describe(written(wrong.other_focal(good, 10), tmp_path / "other"))
    assert "about 0.1 times the given one fits" in said_of["findings"]


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


def test_a_camera_of_images_of_another_size_is_named(good: Capture) -> None:
    def with_camera(factor: float, down: float = 1.0) -> Capture:
        def change(frame: Frame) -> Frame:
            k = frame.camera.intrinsics
            k = replace(
                k, fx=k.fx * factor, fy=k.fy * factor, cx=k.cx * factor, cy=k.cy * factor * down
            )
            return replace(frame, camera=replace(frame.camera, intrinsics=k))

        return wrong.each_frame(good, change)

    k = good.frames[0].camera.intrinsics
    for factor in (2.0, 1 / k.width):
        kinds = [each.kind for each in check_capture(with_camera(factor)).findings if each.is_error]
        assert kinds[0] == "camera", factor
    assert f"of about {2 * k.width}x{2 * k.height} pixels" in said(with_camera(2.0))[0]
    shifted = [each.kind for each in check_capture(with_camera(1.0, 1.5)).findings]
    assert "camera" not in shifted  # a part of an image


@pytest.mark.parametrize(
    ("parts", "odd"),
    [("aabaa", [2]), ("aabcaa", [2, 3]), ("baaa", [0]), ("aabcc", []), ("aaaccc", [])],
)
def test_a_frame_between_two_parts_of_a_path_is_no_outlier(parts: str, odd: list[int]) -> None:
    """Frames of the same letter agree."""
    near = [(i, j) for j in range(len(parts)) for i in range(max(0, j - REACH), j)]
    relative = {frozenset(pair): 1.0 if parts[pair[0]] == parts[pair[1]] else 0.5 for pair in near}
    assert alone(Links(tuple(parts), relative), 0.75) == odd


TURNS = {
    "z up": np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]),
    "a quarter": np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]),
    "any": matrix_from_rotation_vector(np.array([0.4, 0.9, -0.5])),
    "millimetres": 1000 * np.eye(3),
}


@pytest.mark.parametrize("name", ["right", *TURNS])
@pytest.mark.parametrize("has_depth", [True, False])
def test_points_that_are_turned_against_the_cameras_are_found(
    good: Capture, tmp_path: Path, name: str, has_depth: bool
) -> None:
    turned = wrong.with_points(good, tmp_path, TURNS.get(name, np.eye(3)))
    if not has_depth:
        turned = wrong.each_frame(turned, lambda frame: frame.without_layer(Layer.DEPTH))
    findings = [each for each in check_capture(turned).findings if each.kind == "points"]
    assert len(findings) == (name != "right")
    if name in ("z up", "a quarter"):
        assert "if they are turned by right angles" in findings[0].what


def test_limits_keep_a_distance_from_the_good_and_the_damaged(good: Capture) -> None:
    def spoilt(damage: str) -> Capture:
        return WRONG[damage][0](good)

    most_moved, steady = map(limit_of, ("moving things", "exposure"))
    assert MARGIN * share_that_moved(good) < most_moved
    assert share_that_moved(spoilt("balls")) > MARGIN * most_moved
    here, there = (median_exposure_change(Evidence(c)) for c in (good, spoilt("exposure")))
    assert here is not None and there is not None
    assert MARGIN * here < steady and there > MARGIN * steady


@pytest.mark.parametrize("kind", ["hololens_room_sequence", "tum_cabinet_orbit"])
def test_real_recordings_have_no_finding_until_they_are_spoiled(
    sample_data: Path, kind: str
) -> None:
    capture = recorded(sample_data / "rgbd" / kind, kind)
    assert check_capture(capture).findings == ()
    assert MARGIN * share_that_moved(capture) < limit_of("moving things")
    for spoil, cause in (
        *(WRONG[name] for name in ("x1000", "OpenCV axes", "exposure", "balls", "gripper")),
        (lambda c: wrong.other_focal(c, 2), "about 0.5 times the given one fits"),
        (lambda c: wrong.shifted_depth(c, 20), "depth and images do not have the same camera"),
    ):
        (finding,) = check_capture(spoil(capture)).findings
        assert re.search(cause, f"{finding.kind}: {finding}")


def test_the_command_ends_well_for_a_good_capture_and_badly_for_one_with_errors(
    good: Capture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = tmp_path / "check.json"
    assert main(["check", str(written(good, tmp_path / "good"))]) == EXIT_OK
    assert "nothing wrong was found" in capsys.readouterr().out
    few = written(replace(good, frames=good.frames[::6]), tmp_path / "few")
    assert main(["check", str(few), "--json", str(report)]) == EXIT_OK
    printed = capsys.readouterr().out
    assert "warning: few views: The recording has only 3 frames" in printed
    (finding,) = json.loads(report.read_text())["findings"]
    assert finding["kind"] == "few views" and not finding["is_error"]
    assert f"to mend it: {finding['remedy']}" in printed
    wrong_folder = written(wrong.opencv_axes(good), tmp_path / "wrong")
    arguments = ["check", str(wrong_folder), "--json", str(report)]
    assert main(arguments) == EXIT_BAD_INPUT
    assert "the file exists" in capsys.readouterr().err
    assert main([*arguments, "--overwrite"]) == EXIT_BAD_INPUT
    assert "error: pose convention" in capsys.readouterr().err
    assert json.loads(report.read_text())["findings"][0]["kind"] == "pose convention"


def test_what_moves_with_the_camera_is_marked_and_then_left_out(
    good: Capture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, mask = str(written(wrong.with_gripper(good), tmp_path / "grip")), tmp_path / "mask.png"
    assert main(["check", folder, "--write-ignore-mask", str(mask)]) == EXIT_OK
    marked = read_image(mask)[..., 0]
    hidden = np.zeros(marked.shape, bool)
    hidden[63:, 64:96] = True
    assert marked[hidden].min() == 255 and (marked[~hidden] > 0).mean() < 0.1
    left_out = without_no_scene(read_capture(Path(folder)), mask, tmp_path / "layer")
    assert said(left_out) == []
    clean = str(written(good, tmp_path / "clean"))
    arguments = ["check", clean, "--write-ignore-mask", str(mask)]
    assert main(arguments) == EXIT_BAD_INPUT
    assert "the file exists" in capsys.readouterr().err
    assert main([*arguments, "--overwrite"]) == EXIT_BAD_INPUT
    assert "nothing in" in capsys.readouterr().err


def test_depth_of_what_is_too_far_for_two_eyes_is_no_wrong_order(good: Capture) -> None:
    rng = np.random.default_rng(0)
    noisy = wrong.each_frame(
        wrong.scaled_depth(good, 6.0),
        lambda f: f.with_layer(
            Layer.DEPTH, (f.load_depth() * rng.uniform(0.3, 3, (90, 160))).astype(np.float32)
        ),
    )
    (finding,) = check_capture(noisy).findings
    assert finding.kind == "distance" and not finding.is_error and "Come nearer" in finding.remedy
    (finding,) = check_capture(replace(noisy, rig=None)).findings
    assert finding.kind == "order"


def test_what_cannot_be_looked_at_is_said(good: Capture) -> None:
    bare = wrong.each_frame(good, lambda f: f.without_layer(Layer.DEPTH).without_layer(Layer.MASK))
    found = check_capture(bare)
    assert found.findings == ()
    assert [each.split(":")[1].strip() for each in found.not_checked] == [
        "need depth",
        "the recording has none",
    ]


FRAMES, WIDTH = 18, 160
STEPS = 12  # frames of the photographs without depth
JUMP_MARGIN = 1.3
OUTLIERS = "outlier frames", "break"


def look_for(capture: Capture, *kinds: str) -> list[Finding]:
    """What the checks of some kinds find."""
    evidence = Evidence(capture)
    found = (check.look(evidence) for check in CHECKS if check.kind in kinds)
    return [each for each in found if each is not None]


def unposed(capture: Capture) -> Capture:
    return replace(capture, about=replace(capture.about, poses_known=False))


@pytest.mark.parametrize("number", [0, 7, FRAMES - 1])
def test_a_frame_with_a_broken_pose_is_named(good: Capture, number: int) -> None:
    (found,) = look_for(with_a_jump(good, (0.0, 0.0, 0.1), 40.0, [number]), *OUTLIERS)
    assert found.kind == "outlier frames" and not found.is_error
    assert found.what.endswith(f"after: {good.frames[number].name}.")


def test_two_recordings_in_one_break_between_them(good: Capture) -> None:
    two = with_a_jump(good, (0.0, 0.0, 0.1), 40.0)
    assert look_for(unposed(two), *OUTLIERS) == []
    (found,) = look_for(two, *OUTLIERS)
    assert found.kind == "break" and found.is_error
    assert f"between frames {good.frames[8].name} and {good.frames[9].name}." in found.what


def test_a_camera_that_comes_back_does_not_break(good: Capture) -> None:
    """Looking away at once, and back at what was seen before."""
    half = FRAMES // 2
    order = [*range(0, FRAMES, half), *range(1, FRAMES, half), *range(2, FRAMES, half)]
    there_and_back = replace(good, frames=tuple(good.frames[i] for i in order))
    assert look_for(there_and_back, *OUTLIERS) == []


def spoilt(mask: np.ndarray, how: str) -> np.ndarray:
    """The mask as a segmentation may fail: nothing, half of the object, or something beside it, too."""
    mask = mask.copy()
    rows, columns = np.nonzero(mask > 127)
    if how == "empty":
        mask[:] = 0
    elif how == "cut":
        mask[:, : int(np.median(columns))] = 0
    else:
        top, right = int(np.median(rows)), columns.max() - 2
        mask[top : rows.max() + 1, right : right + np.ptp(columns)] = 255
    return mask


@pytest.mark.parametrize("noise", [0.0, 3.0])
def test_a_camera_at_rest_and_doubled_frames_are_told(good: Capture, noise: float) -> None:
    rng = np.random.default_rng(0)

    def again(number: int) -> Frame:
        frame = good.frames[number]
        image = frame.load_image() + rng.normal(0, noise, (90, WIDTH, 3))
        return frame.with_layer(Layer.IMAGE, np.clip(image, 0, 255).astype(np.uint8))

    (rest,) = look_for(replace(good, frames=tuple(again(4) for _ in range(6))), "repeats")
    assert "5 frames of 6 repeat the one before" in rest.what
    (doubled,) = look_for(replace(good, frames=tuple(again(i // 2) for i in range(12))), "repeats")
    assert "6 frames of 12 repeat the one before" in doubled.what
    one_pause = (*good.frames[:8], again(7), *good.frames[8:])
    assert look_for(replace(good, frames=one_pause), "repeats") == []


@pytest.fixture(scope="module")
def arc() -> Capture:
    """An arc around the built-in object in its room."""
    walk = WalkSettings(path="arc", elevations=(30.0,))
    config = SimulateConfig(
        profile="bare-matcher", frames=STEPS, width=320, height=180, samples_per_pixel=1, walk=walk
    )
    return simulate_in_memory(config)


def test_masks_that_those_around_contradict_are_named(good: Capture, arc: Capture) -> None:
    odd = {2: "empty", 5: "cut", 8: "neighbor"}

    def with_wrong_mask(frame: Frame) -> Frame:
        how = odd.get(int(frame.name))
        return frame.with_layer(Layer.MASK, spoilt(frame.load_mask(), how)) if how else frame

    assert look_for(good, "masks disagree") == look_for(arc, "masks disagree") == []
    (found,) = look_for(each_frame(arc, with_wrong_mask), "masks disagree", *OUTLIERS)
    assert found.kind == "masks disagree" and not found.is_error
    assert "3 masks of 12" in found.what
    assert all(arc.frames[number].name in found.what for number in odd)


def bare(capture: Capture) -> Capture:
    return each_frame(capture, lambda f: f.without_layer(Layer.DEPTH).without_layer(Layer.MASK))


@pytest.mark.parametrize(("shift", "turn"), [((0.0, 0.0, 0.1), 0.0), ((0.5, -0.2, 0.0), 40.0)])
def test_a_jump_is_named(arc: Capture, shift: tuple[float, float, float], turn: float) -> None:
    jumping = with_a_jump(bare(arc), shift, turn)
    (found,) = check_capture(jumping).findings
    assert found.kind == "pose jump" and not found.is_error
    before, after = (arc.frames[STEPS // 2 + i].name for i in (-1, 0))
    assert f"between frames {before} and {after}:" in found.what
    # Depth tells more, and poses that are unknown tell nothing.
    depth = np.ones((180, 320), np.float32)
    deep = each_frame(jumping, lambda frame: frame.with_layer(Layer.DEPTH, depth))
    assert look_for(deep, "pose jump") == look_for(unposed(jumping), "pose jump") == []


def test_right_poses_have_none(arc: Capture) -> None:
    assert check_capture(bare(arc)).findings == ()
    shares = [share for share in agreeing_shares(bare(arc).frames) if share is not None]
    assert len(shares) > STEPS / 2
    assert min(shares) > JUMP_MARGIN * limit_of("pose jump")
    assert np.median(shares) > JUMP_MARGIN * USUAL_MATCH_SHARE


def test_exposure_of_photographs_is_told_by_what_they_match(arc: Capture) -> None:
    """Half a stop from frame to frame, with poses or without."""

    def other_exposure(frame: Frame) -> Frame:
        light = 0.5 * (frame.load_image() / 255.0) ** 2.2 * 2 ** (0.5 * (int(frame.name) % 2))
        return frame.with_layer(Layer.IMAGE, (255 * light ** (1 / 2.2)).astype(np.uint8))

    uneven = each_frame(bare(arc), other_exposure)
    for capture in (uneven, unposed(uneven)):
        (found,) = look_for(capture, "exposure")
        assert "changes by 0.5 stops" in found.what
    assert look_for(bare(arc), "exposure") == []


def test_a_real_room_without_its_depth_has_none_until_it_jumps(sample_data: Path) -> None:
    room = bare(recorded(sample_data / "rgbd" / "hololens_room_sequence", "hololens_room_sequence"))
    assert check_capture(room).findings == ()
    (found,) = look_for(with_a_jump(room, (0.3, 0.0, 0.2), 20.0), "pose jump")
    assert found.kind == "pose jump"
