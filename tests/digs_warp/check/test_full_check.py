"""Damaged captures: the finding that comes first names the damage; good captures have none.

`MARGIN` is kept between each limit and both the good and the damaged captures.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.check.alignment import OutlineFit, outlines
from digs_warp.check.check import check_capture
from digs_warp.check.evidence import Evidence
from digs_warp.check.findings import limit_of
from digs_warp.check.motion import moved_share
from digs_warp.check.recording import median_exposure_change, median_sharpness, widest_gap
from digs_warp.check.thresholds import LEAST_OUTLINE_OFFSET
from digs_warp.cli import EXIT_BAD_INPUT, EXIT_OK, main
from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.layers import Layer
from digs_warp.geometry.rigid import matrix_from_rotation_vector
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate_in_memory
from reference import wrong_captures as wrong
from reference.real_captures import recorded

MARGIN = 1.5
FRAMES, WIDTH = 18, 160
SHIFT = 6  # columns

OTHER_ORDER = np.random.default_rng(1).permutation(FRAMES).tolist()

DAMAGES: dict[str, tuple[Callable[[Capture], Capture], str]] = {
    "depth x1000": (lambda c: wrong.scaled_depth(c, 1000), "depth unit"),
    "focal x1.3": (lambda c: wrong.other_focal(c, 1.3), "focal length"),
    "OpenCV axes": (wrong.opencv_axes, "pose convention"),
    "inverted poses": (wrong.inverted, "pose convention"),
    "shuffled": (lambda c: wrong.poses_of(c, OTHER_ORDER), "order|time stamps"),
    "masks of a pixel": (lambda c: wrong.masks_of(c, 1), "masks empty"),
    "masks of three pixels": (lambda c: wrong.masks_of(c, 3), "masks empty"),
    "masks of nothing": (lambda c: wrong.masks_of(c, 0), "masks empty"),
    "inverted masks": (wrong.inverted_masks, "masks inverted"),
    "eroded masks": (lambda c: wrong.eroded_masks(c, 5), "masks cut"),
    "moved masks": (lambda c: wrong.moved_masks(c, SHIFT), "masks moved"),
    "moved depth": (lambda c: wrong.shifted_depth(c, SHIFT), "alignment"),
    "blur": (lambda c: wrong.blurred(c, 3.0), "blur"),
    "exposure": (lambda c: wrong.other_exposures(c, 2.0), "exposure"),
    "balls": (lambda c: wrong.with_passing_balls(c, 0.2), "moving things"),
    "3 views": (lambda c: replace(c, frames=c.frames[::6]), "few views"),
    "half a circle": (wrong.without_half_of_the_circle, "gap"),
}


@pytest.fixture(scope="module")
def good() -> Capture:
    return simulate_in_memory(
        SimulateConfig(frames=FRAMES, width=WIDTH, height=90, samples_per_pixel=2)
    )


def kinds(capture: Capture) -> list[str]:
    return [each.kind for each in check_capture(capture).findings]


def fit_of(capture: Capture) -> OutlineFit:
    fit = outlines(Evidence(capture))
    assert fit is not None
    return fit


def share_that_moved(capture: Capture) -> float:
    evidence = Evidence(capture)
    return moved_share(evidence.frames, evidence.pairs)


def test_a_good_capture_has_no_finding(good: Capture) -> None:
    assert kinds(good) == []


@pytest.mark.parametrize("damage", DAMAGES)
def test_the_damage_is_the_only_finding(good: Capture, damage: str) -> None:
    spoil, kind = DAMAGES[damage]
    (found,) = kinds(spoil(good))
    assert found in kind.split("|")


TURNS = {
    "z up": np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]),
    "y down": np.diag([1, -1, -1.0]),
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
    if name in ("z up", "y down", "a quarter"):
        assert "if they are turned" in findings[0].what


def test_limits_keep_a_distance_from_the_good_and_the_damaged(good: Capture) -> None:
    def spoilt(damage: str) -> Capture:
        return DAMAGES[damage][0](good)

    most_moved, steady, sharp = map(limit_of, ("moving things", "exposure", "blur"))
    assert MARGIN * share_that_moved(good) < most_moved
    assert share_that_moved(spoilt("balls")) > MARGIN * most_moved
    here, there = (median_exposure_change(Evidence(c)) for c in (good, spoilt("exposure")))
    assert here is not None and there is not None
    assert MARGIN * here < steady and there > MARGIN * steady
    clear, blurred = (median_sharpness(Evidence(c)) for c in (good, spoilt("blur")))
    assert clear is not None and blurred is not None
    fully_blurred = 0.25  # the least value of the measure
    limit = sharp - fully_blurred
    assert clear - fully_blurred > MARGIN * limit
    assert MARGIN * (blurred - fully_blurred) < limit
    gaps = [
        widest_gap([frame.camera for frame in each.frames])
        for each in (good, spoilt("half a circle"))
    ]
    assert gaps[0] is not None and gaps[1] is not None
    assert MARGIN * gaps[0] < limit_of("gap") and gaps[1] > MARGIN * limit_of("gap")
    assert MARGIN * max(fit_of(good).offset, fit_of(good).cut) <= LEAST_OUTLINE_OFFSET
    assert fit_of(spoilt("moved masks")).offset >= MARGIN * LEAST_OUTLINE_OFFSET
    assert fit_of(spoilt("moved depth")).offset >= MARGIN * LEAST_OUTLINE_OFFSET
    cut = fit_of(spoilt("eroded masks"))
    assert cut.cut >= MARGIN * LEAST_OUTLINE_OFFSET
    assert cut.larger > MARGIN * limit_of("masks cut")


@pytest.mark.parametrize("kind", ["hololens_room_sequence", "tum_cabinet_orbit"])
def test_real_recordings_have_no_finding_until_they_are_damaged(
    sample_data: Path, kind: str
) -> None:
    capture = recorded(sample_data / "rgbd" / kind, kind)
    assert kinds(capture) == []
    assert MARGIN * share_that_moved(capture) < limit_of("moving things")
    for damage in ("OpenCV axes", "blur", "exposure", "balls"):
        spoil, expected = DAMAGES[damage]
        assert kinds(spoil(capture)) == [expected]


def written(capture: Capture, folder: Path) -> Path:
    writer = CaptureWriter(folder, capture.frames[0].camera.intrinsics)
    for number, frame in enumerate(capture.frames):
        images = FrameImages(frame.load_image(), frame.load_depth(), frame.load_mask())
        writer.write_frame(number, images)
        writer.add_pose(number, frame.camera.world_from_cam, frame.time)
    writer.finish()
    return folder


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


def test_what_cannot_be_looked_at_is_said(good: Capture) -> None:
    bare = wrong.each_frame(good, lambda f: f.without_layer(Layer.DEPTH).without_layer(Layer.MASK))
    found = check_capture(bare)
    assert found.findings == ()
    assert [each.split(":")[1].strip() for each in found.not_checked] == [
        "need depth",
        "need masks",
    ]
