"""Poses, scale and initialization together: on photographs of the built-in scene with true depth."""

import logging
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.init.config import InitConfig
from digs_warp.masks.config import SegmentConfig
from digs_warp.pipeline.config import FrontEndConfig, SubjectChoice, subject_of
from digs_warp.pipeline.front_end import FrontEnd, front_end, load_front_end
from digs_warp.pipeline.optimize import pose_training
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.refine.photometric_alignment import in_place
from digs_warp.record.run_log import RunLog, RunRecord
from reference.ball_capture import WALL_RADIUS, ball_views, write_capture
from reference.perturbed_poses import perturbed_capture
from reference.sfm_views import arc, record
from reference.wrong_captures import other_focal

# The photographs are small: features are also sought in the image enlarged twice.
SFM = SfmConfig(double_size=True, features=1500, pairing="sequential", overlap=4, loop_images=0)
FIND_POSES = FrontEndConfig(sfm=SFM, test_every=4, init=InitConfig(voxel_size=0.01))


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return record(arc(12), tmp_path_factory.mktemp("arc"))


@pytest.fixture(scope="module")
def found(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> tuple[FrontEnd, Path]:
    folder = tmp_path_factory.mktemp("reconstruction")
    return front_end(capture, FIND_POSES, folder, RunLog("test", FIND_POSES)), folder


def test_estimated_cameras_are_metric_and_lie_in_the_recordings_world(
    capture: Capture, found: tuple[FrontEnd, Path]
) -> None:
    frames = found[0].poses.posed
    true = {frame.name: frame.camera for frame in capture.frames}
    assert len(frames.training) == 9 and len(frames.held_out) == 3
    for frame in (*frames.training, *frames.held_out):
        error = frame.camera.center_world - true[frame.name].center_world
        # The depth is true, so what is left is the error of poses from photographs of 320x240 px.
        assert np.linalg.norm(error) < 0.004
    assert found[0].poses.scale is not None and found[0].poses.sfm is not None
    assert found[0].poses.scale.sfm_per_metre == frames.sfm_per_metre
    assert found[0].poses.sfm.registered == 12


@pytest.mark.parametrize("strategy", ["default", "fusion", "random"])
def test_sparse_points_are_triangulated_from_given_poses(
    capture: Capture, found: tuple[FrontEnd, Path], strategy: str, tmp_path: Path
) -> None:
    init = InitConfig(strategy=strategy, voxel_size=0.01)  # pyright: ignore[reportArgumentType]
    config = replace(FIND_POSES, sfm=replace(SFM, poses="capture"), init=init)
    shutil.copytree(found[1] / "sfm", tmp_path / "sfm")  # the same features and matches
    prepared = front_end(capture, config, tmp_path, RunLog("test", config))
    frames, sources = prepared.poses.posed, prepared.start.sources
    assert sum(sources.values()) == len(prepared.start.points)
    assert ("sfm" in sources) == (strategy != "random")
    assert frames.sfm_per_metre == 1.0
    for frame, original in zip(frames.training, capture.split(4)[0], strict=True):
        difference = frame.camera.world_from_cam - original.camera.world_from_cam
        assert np.abs(difference).max() < 1e-6


def test_a_capture_that_does_not_fit_together_is_found_and_recorded(
    capture: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    config = FrontEndConfig(test_every=4)
    log = RunLog("test", config)
    assert front_end(capture, config, tmp_path / "good", log).poses.findings == ()
    assert log.results["poses"]["findings"] == [] and caplog.text == ""
    wrong = other_focal(capture, 1.3)
    prepared = front_end(wrong, config, tmp_path / "wrong", log)
    (finding,) = prepared.poses.findings
    assert "focal length (about 0.77 times the given one fits)" in finding
    assert finding in caplog.text and log.results["poses"]["findings"] == [finding]
    log.save(tmp_path / "wrong/run.json")
    assert load_front_end(wrong, tmp_path / "wrong").poses.findings == (finding,)


def test_frames_that_were_not_registered_are_left_out(
    capture: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A black image among the others; it would be frame 5, of those that train."""
    from digs_warp.data.images import read_image, write_image

    folder = tmp_path / "capture"
    shutil.copytree(capture.folder, folder)
    broken = read_capture(folder)
    path = broken.frames[5].path(Layer.IMAGE)
    write_image(path, np.zeros_like(read_image(path)))
    config = replace(FIND_POSES, sfm=replace(SFM, min_registered=0.8))
    with caplog.at_level(logging.WARNING):
        frames = front_end(
            read_capture(folder), config, tmp_path / "out", RunLog("test", {})
        ).poses.posed
    assert broken.frames[5].name not in [frame.name for frame in frames.training]
    assert len(frames.training) == 8
    assert broken.frames[5].name in caplog.text


def test_other_masks_serve_the_training_and_not_the_measurement(
    capture: Capture, tmp_path: Path
) -> None:
    config = FrontEndConfig(test_every=4, segment=SegmentConfig(masks="depth"))
    frames = front_end(capture, config, tmp_path, RunLog("test", {})).poses.posed
    assert {frame.path(Layer.MASK).parent for frame in frames.training} == {tmp_path / "masks"}
    for frame, original in zip(frames.held_out, capture.split(4)[1], strict=True):
        assert frame.path(Layer.MASK) == original.path(Layer.MASK)
    again = PosedFrames.load(capture, tmp_path)
    assert [frame.layers for frame in again.training] == [frame.layers for frame in frames.training]


def test_perturbed_poses_are_refined_and_written(capture: Capture, tmp_path: Path) -> None:
    config = replace(FIND_POSES, sfm=replace(SFM, poses="capture", refine_poses="on"))
    prepared = front_end(perturbed_capture(capture), config, tmp_path, RunLog("test", config))
    assert prepared.poses.refinement is not None and prepared.poses.refinement.refined
    true = {frame.name: frame.camera for frame in capture.frames}
    every = (*prepared.poses.posed.training, *prepared.poses.posed.held_out)
    assert len(every) == 12
    found = np.array([frame.camera.world_from_cam for frame in every])
    expected = np.array([true[frame.name].world_from_cam for frame in every])
    # The frames together stay where the perturbed ones were on average.
    apart = in_place(found, expected, 1.0) - expected
    looked_at = apart[:, :3, 3] + 2.0 * apart[:, :3, 2]  # a point 2 m ahead, in a room of 5 m
    assert np.sqrt((looked_at**2).sum(axis=1).mean()) < 0.012  # 24 mm as perturbed
    again = load_front_end(capture, tmp_path)
    assert again.poses.refinement == prepared.poses.refinement
    loaded = (*again.poses.posed.training, *again.poses.posed.held_out)
    for frame, kept in zip(every, loaded, strict=True):
        assert (frame.camera.world_from_cam == kept.camera.world_from_cam).all()


@pytest.mark.parametrize(("off", "choice"), [(0.0, "auto"), (0.1, "auto"), (0.1, "off")])
def test_without_depth_cameras_move_where_matched_features_miss_their_poses(
    capture: Capture, found: tuple[FrontEnd, Path], tmp_path: Path, off: float, choice: str
) -> None:
    given = perturbed_capture(capture, off, 0.0).frames
    photographs = replace(capture, frames=tuple(f.without_layer(Layer.DEPTH) for f in given))
    sfm = replace(SFM, poses="capture", refine_poses=choice)  # pyright: ignore[reportArgumentType]
    config = replace(FIND_POSES, sfm=sfm, init=InitConfig(strategy="default"))
    shutil.copytree(found[1] / "sfm", tmp_path / "sfm")  # the same features and matches
    poses = front_end(photographs, config, tmp_path, log := RunLog("test", config)).poses
    assert poses.refinement is not None and not poses.refinement.refined
    moves = off > 0 and choice == "auto"
    assert pose_training(poses.refinement) == ("moved" if moves else "held")
    assert ("(--refine-poses off holds" in log.results["poses"]["refinement"]["because"]) == moves


QUARTER = FrontEndConfig(init=InitConfig(edge_filter=False), test_every=4)


@pytest.fixture(scope="module")
def masked(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_capture(tmp_path_factory.mktemp("ball"), ball_views())


@pytest.fixture(scope="module")
def unmasked(masked: Capture) -> Capture:
    return replace(masked, frames=tuple(f.without_layer(Layer.MASK) for f in masked.frames))


def prepared(capture: Capture, folder: Path, choice: SubjectChoice = "auto") -> FrontEnd:
    config = replace(QUARTER, subject=choice)
    return front_end(capture, config, folder, RunLog("test", config))


def farthest(result: FrontEnd) -> float:
    return float(np.linalg.norm(result.start.points.points_world, axis=1).max())


def test_masks_decide(masked: Capture, unmasked: Capture) -> None:
    from_depth = SegmentConfig(masks="depth")
    assert subject_of(masked, "auto", SegmentConfig()) == "object"
    assert subject_of(unmasked, "auto", SegmentConfig()) == "scene"
    assert subject_of(unmasked, "auto", from_depth) == "object"
    assert subject_of(masked, "scene", SegmentConfig()) == "scene"
    assert subject_of(unmasked, "object", SegmentConfig()) == "object"
    with pytest.raises(DigsError, match="scene: no masks are used; leave out --masks depth"):
        subject_of(unmasked, "scene", from_depth)


def test_without_masks_everything_in_view_is_reconstructed_and_the_log_says_so(
    unmasked: Capture, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO):
        result = prepared(unmasked, tmp_path)
    assert result.poses.subject == "scene"
    assert farthest(result) > 0.9 * WALL_RADIUS
    assert "no masks, so everything in view is reconstructed (--subject scene)" in caplog.text
    assert "add --masks depth" in caplog.text


def test_a_scene_leaves_the_masks_of_the_recording_alone(masked: Capture, tmp_path: Path) -> None:
    result = prepared(masked, tmp_path, "scene")
    assert farthest(result) > 0.9 * WALL_RADIUS
    every = (*result.poses.posed.training, *result.poses.posed.held_out)
    assert not any(frame.has(Layer.MASK) for frame in every)
    record = RunRecord.find(tmp_path)
    assert record is not None and record.results["poses"]["subject"] == "scene"
    # What is read again, for a report or to continue, has no masks either.
    again = load_front_end(masked, tmp_path)
    assert again.poses.subject == "scene"
    assert not any(frame.has(Layer.MASK) for frame in again.poses.posed.training)


def test_a_smear_is_refused_before_any_work(tmp_path: Path) -> None:
    k, rng = Intrinsics.from_fov(160, 120, 50.0), np.random.default_rng(0)
    surroundings, frames = rng.integers(0, 256, (30, 40, 3)), []
    for number in range(8):
        small = surroundings.copy()
        small[10:20, 15:25] = rng.integers(0, 256, (10, 10, 3))  # the object has turned
        image = small.repeat(4, axis=0).repeat(4, axis=1).astype(np.uint8)
        angle = 2 * np.pi * number / 8
        eye = np.array([np.cos(angle), np.sin(angle), 0.3])
        camera = Camera(k, look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0])))
        layers = {Layer.IMAGE: image, Layer.DEPTH: np.ones((120, 160), np.float32)}
        frames.append(Frame(f"{number:04d}", camera, float(number), layers))
    capture = Capture(None, tuple(frames), None)
    with pytest.raises(DigsError, match=r"stands still.*masks.*--poses auto.*--ignore-mask"):
        front_end(capture, FrontEndConfig(), tmp_path, RunLog("test", {}))
