"""Single frames in a wrong place: found, registered again or left out; good recordings stay as they are."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.geometry.rigid import matrix_from_rotation_vector, rigid
from digs_warp.masks.agreed import agreed_masks
from digs_warp.pipeline.config import FrontEndConfig
from digs_warp.pipeline.front_end import front_end
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.refine.photometric_alignment import align
from digs_warp.poses.refine.refine import refine
from digs_warp.poses.refine.relocalization import relocated
from digs_warp.poses.views import load_pictures
from digs_warp.record.run_log import RunLog
from reference.perturbed_poses import perturbed_poses

WRONG = 3


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Half a turn around the built-in object."""
    settings = {"width": 320, "tier": "law", "camera_path": "arc", "seed": 3}
    return dw.simulate(
        frames=12, elevations=(20.0,), out=tmp_path_factory.mktemp("arc") / "capture", **settings
    )


@pytest.fixture(scope="module")
def orbits(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """All around the built-in object in wide steps."""
    settings = {"width": 320, "tier": "law", "camera_path": "orbits", "seed": 3}
    return dw.simulate(frames=16, out=tmp_path_factory.mktemp("orbits") / "capture", **settings)


def poses_of(frames: Sequence[Frame]) -> np.ndarray:
    return np.stack([frame.camera.world_from_cam for frame in frames])


def turned(pose: np.ndarray, degrees: float = 20.0) -> np.ndarray:
    """A camera elsewhere, round the vertical axis of the world, and looking elsewhere."""
    turn = rigid(matrix_from_rotation_vector(np.radians([0.0, 0.0, degrees])), np.zeros(3))
    return turn @ pose @ rigid(matrix_from_rotation_vector(np.array([0.0, 0.1, 0.0])), np.zeros(3))


def with_one_wrong(capture: Capture) -> list[Frame]:
    frames = list(capture.frames)
    camera = frames[WRONG].camera
    moved = replace(camera, world_from_cam=turned(camera.world_from_cam))
    frames[WRONG] = replace(frames[WRONG], camera=moved)
    return frames


def mirrored(frame: Frame) -> Frame:
    for layer, values in ((Layer.IMAGE, frame.load_image()), (Layer.DEPTH, frame.load_depth())):
        frame = frame.with_layer(layer, np.ascontiguousarray(values[:, ::-1]))
    return frame


def apart(found: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Return how far two poses differ [m, degree]."""
    chord = np.linalg.norm((found - true)[:3, :3]) / np.sqrt(8.0)
    length = np.linalg.norm((found - true)[:3, 3])
    return float(length), float(np.degrees(2 * np.arcsin(chord)))


def test_a_frame_in_a_wrong_place_is_registered_again(capture: Capture) -> None:
    frames, true = with_one_wrong(capture), poses_of(capture.frames)
    assert apart(poses_of(frames)[WRONG], true[WRONG])[1] > 10.0
    found = relocated(load_pictures(frames, 0.0), poses_of(frames))
    assert (found.moved, found.lost) == ((WRONG,), ())
    length, turn = apart(found.poses[WRONG], true[WRONG])
    assert length < 0.02
    assert turn < 1.0
    others = np.arange(len(true)) != WRONG
    np.testing.assert_array_equal(found.poses[others], true[others])


def test_refined_poses_have_the_frame_in_its_place_and_say_so(capture: Capture) -> None:
    frames, refinement = refine(with_one_wrong(capture), 0.0, needed=False)
    assert f"registered again: {frames[WRONG].name}" in refinement.because
    assert apart(poses_of(frames)[WRONG], poses_of(capture.frames)[WRONG])[1] < 1.0


def test_a_frame_that_cannot_be_placed_is_left_out(capture: Capture) -> None:
    """No camera sees the scene in a mirror."""
    frames = list(capture.frames)
    frames[WRONG] = mirrored(frames[WRONG])
    left, _ = refine(frames, 0.0, needed=False)
    assert [f.name for f in left] == [f.name for f in frames if f is not frames[WRONG]]


@pytest.mark.parametrize(("seed", "number"), [(2, 1), (5, 3)])
def test_right_frames_stay_where_all_poses_are_off(orbits: Capture, seed: int, number: int) -> None:
    """A frame that agrees with no other before all are aligned does so afterwards."""
    true = poses_of(orbits.frames)
    given = np.stack(perturbed_poses(list(true), 1.0, 0.01, seed))
    pictures = load_pictures(orbits.frames, 0.0)
    found = relocated(pictures, given)
    assert (found.moved, found.lost) == ((number,), ())
    others = np.arange(len(true)) != number
    np.testing.assert_array_equal(found.poses[others], given[others])
    alignment = align(pictures, found.poses, found.start)
    assert alignment is not None
    before, after = (apart(poses[number], true[number])[1] for poses in (given, alignment.poses))
    assert after < 0.5 * before


def looking_away(pose: np.ndarray) -> np.ndarray:
    """The camera after a quarter turn: it has nothing in common with any."""
    turn = matrix_from_rotation_vector(np.array([0.0, np.pi / 2, 0.0]))
    return pose @ rigid(turn, np.zeros(3))


def test_a_frame_that_shares_nothing_with_others_is_registered_again(capture: Capture) -> None:
    true = poses_of(capture.frames)
    given = true.copy()
    given[WRONG] = looking_away(true[WRONG])
    found = relocated(load_pictures(capture.frames, 0.0), given)
    assert (found.moved, found.lost) == ((WRONG,), ())
    length, turn = apart(found.poses[WRONG], true[WRONG])
    assert length < 0.02
    assert turn < 1.0


def test_a_frame_that_sees_what_no_other_sees_stays(capture: Capture) -> None:
    frames = list(capture.frames)
    frames[WRONG] = mirrored(frames[WRONG])
    given = poses_of(frames)
    given[WRONG] = looking_away(given[WRONG])
    found = relocated(load_pictures(frames, 0.0), given)
    assert (found.moved, found.lost) == ((), ())
    np.testing.assert_array_equal(found.poses, given)


def test_good_poses_stay_bit_by_bit(capture: Capture) -> None:
    true = poses_of(capture.frames)
    found = relocated(load_pictures(capture.frames, 0.0), true)
    assert (found.moved, found.lost) == ((), ())
    np.testing.assert_array_equal(found.poses, true)


def test_a_frame_of_another_exposure_is_not_left_out(capture: Capture) -> None:
    pictures, true = load_pictures(capture.frames, 0.0), poses_of(capture.frames)
    pictures[WRONG] = replace(pictures[WRONG], brightness=0.4 * pictures[WRONG].brightness)
    found = relocated(pictures, true)
    assert not found.lost
    assert apart(found.poses[WRONG], true[WRONG])[1] < 0.5


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_frames_do_not_tell_which_is_wrong(capture: Capture, count: int) -> None:
    frames = with_one_wrong(capture)[WRONG : WRONG + count]
    found = relocated(load_pictures(frames, 0.0), poses_of(frames))
    assert (found.moved, found.lost) == ((), ())


def test_where_all_are_wrong_none_is_moved(capture: Capture) -> None:
    rng = np.random.default_rng(1)
    true = poses_of(capture.frames)
    wrong = np.stack([turned(pose, rng.uniform(-60, 60)) for pose in true])
    found = relocated(load_pictures(capture.frames, 0.0), wrong)
    np.testing.assert_array_equal(found.poses, wrong)
    assert not found.lost


@pytest.mark.parametrize("without", ["all", "the wrong one"])
def test_without_depth_nothing_is_told(capture: Capture, without: str) -> None:
    frames = [
        frame.without_layer(Layer.DEPTH) if without == "all" or number == WRONG else frame
        for number, frame in enumerate(with_one_wrong(capture))
    ]
    found = relocated(load_pictures(frames, 0.0), poses_of(frames))
    np.testing.assert_array_equal(found.poses, poses_of(frames))
    assert not found.lost


def test_a_frame_in_a_wrong_place_keeps_its_good_mask(capture: Capture, tmp_path: Path) -> None:
    """The masks of others contradict it until it is registered again."""
    frames, camera = list(capture.frames), capture.frames[WRONG].camera
    aside = rigid(matrix_from_rotation_vector(np.array([0.0, -0.15, 0.0])), np.zeros(3))
    aside = replace(camera, world_from_cam=camera.world_from_cam @ aside)
    frames[WRONG] = replace(frames[WRONG], camera=aside)
    assert frames[WRONG].name in (agreed_masks(frames, tmp_path / "before")[1] or "")
    config = FrontEndConfig(sfm=SfmConfig(poses="capture", refine_poses="on"))
    moved = replace(capture, frames=tuple(frames))
    prepared = front_end(moved, config, tmp_path / "result", RunLog("test", config))
    assert prepared.poses.refinement is not None
    assert f"registered again: {frames[WRONG].name}" in prepared.poses.refinement.because
    assert not [
        finding for finding in prepared.poses.findings if "contradicted most other views" in finding
    ]
    posed = prepared.poses.posed
    kept = {frame.name: frame for frame in (*posed.training, *posed.held_out)}[frames[WRONG].name]
    np.testing.assert_array_equal(kept.load_mask(), frames[WRONG].load_mask())
