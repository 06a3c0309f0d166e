"""Structure from motion on rendered photographs, end to end through COLMAP."""

import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.layers import Layer
from digs_warp.data.sfm_model import SfmModel
from digs_warp.geometry.camera import Camera
from digs_warp.poses.from_images import colmap
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.estimate import SfmResult, structure_from_motion
from digs_warp.poses.from_images.workspace import key_of, with_scene_masks
from reference.sfm_views import INTRINSICS, arc, photograph
from studies.pose_errors import pose_errors

# The photographs are small: features are also sought in the image enlarged twice.
CONFIG = SfmConfig(double_size=True, features=800, pairing="sequential", overlap=3, loop_images=2)


@pytest.fixture(scope="session")
def views(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    return photograph(arc(12), tmp_path_factory.mktemp("sfm_views"))


@pytest.fixture(scope="session")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("sfm") / "workspace"


@pytest.fixture(scope="session")
def estimated(views: list[Frame], workspace: Path) -> SfmResult:
    return structure_from_motion(views, CONFIG, workspace)


@pytest.fixture
def own_workspace(estimated: SfmResult, workspace: Path, tmp_path: Path) -> Path:
    """A copy with features, matches and model in it."""
    return shutil.copytree(workspace, tmp_path / "workspace")


def reprojection_distances(model: SfmModel) -> np.ndarray:
    """Distance [px] of every measurement to its projected point, by the pinhole formula."""
    seen = model.observations
    distances = np.zeros(len(seen))
    for number, camera in enumerate(model.cameras):
        mine = seen.cameras == number
        px, _ = camera.project(model.points.points_world[seen.points[mine]])
        distances[mine] = np.linalg.norm(px - seen.px[mine], axis=1)
    return distances


def test_poses_come_out_to_a_thousandth_of_the_distance(
    estimated: SfmResult, views: list[Frame]
) -> None:
    errors = pose_errors(estimated.model, views)
    assert estimated.model.names == tuple(frame.name for frame in views)
    assert np.median(errors.centers_m) < 0.002  # at 0.9 m, in images of 320 x 240
    assert errors.centers_m.max() < 0.006
    # The arc is nearly a line, so the rotation about it is only weakly determined for all frames together.
    assert np.median(errors.rotations_deg) < 0.6


def test_points_have_the_colors_of_the_photographs(
    estimated: SfmResult, views: list[Frame]
) -> None:
    model, seen = estimated.model, estimated.model.observations
    mine = seen.cameras == 0
    u, v = np.floor(seen.px[mine]).astype(int).T
    photographed = views[0].load_image()[np.clip(v, 0, 239), np.clip(u, 0, 319)] / 255.0
    difference = np.abs(photographed - model.points.colors[seen.points[mine]]).mean(axis=1)
    assert np.median(difference) < 0.08


def test_the_quality_counts_what_is_in_the_model(estimated: SfmResult) -> None:
    quality, model = estimated.quality, estimated.model
    assert (quality.images, quality.registered, quality.models) == (12, 12, 1)
    assert quality.points == len(model.points) > 300
    assert quality.track_length == pytest.approx(len(model.observations) / len(model.points))
    assert quality.reprojection_error_px == pytest.approx(
        float(reprojection_distances(model).mean()), rel=0.01
    )
    assert "12 of 12 images in 1 model" in str(quality)


def test_a_finished_workspace_is_used_again(
    own_workspace: Path, estimated: SfmResult, views: list[Frame]
) -> None:
    again = structure_from_motion(views, CONFIG, own_workspace)
    assert again.seconds == {}
    assert again.quality == estimated.quality
    np.testing.assert_array_equal(
        again.model.points.points_world, estimated.model.points.points_world
    )


def test_another_image_begins_anew(views: list[Frame], tmp_path: Path) -> None:
    config = replace(CONFIG, poses="capture")
    structure_from_motion(views[:4], config, tmp_path)
    again = structure_from_motion([*views[:3], views[5]], config, tmp_path)
    assert again.seconds.keys() == {"features", "pairs", "match", "map"}
    assert again.model.names == ("0000", "0001", "0002", "0005")
    assert (again.model.observations.cameras == 3).any()


def test_an_interrupted_run_goes_on(
    views: list[Frame], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(colmap, "IMAGES_PER_CALL", 2)
    monkeypatch.setattr(colmap, "PAIRS_PER_CALL", 3)
    calls: list[int] = []
    real = colmap.run_interruptible

    def interrupted_in_the_second_portion_of_pairs(call):
        calls.append(1)
        if len(calls) == 4:  # two portions of images, one of pairs
            raise KeyboardInterrupt
        return real(call)

    config = replace(CONFIG, poses="capture", pairing="exhaustive")
    monkeypatch.setattr(colmap, "run_interruptible", interrupted_in_the_second_portion_of_pairs)
    with pytest.raises(KeyboardInterrupt):
        structure_from_motion(views[:4], config, tmp_path)
    with colmap.quiet_pycolmap().Database.open(tmp_path / "database.db") as db:
        assert (db.num_images(), db.num_matched_image_pairs()) == (4, 3)
    monkeypatch.undo()
    result = structure_from_motion(views[:4], config, tmp_path)
    assert result.quality.registered == 4
    with colmap.quiet_pycolmap().Database.open(tmp_path / "database.db") as db:
        assert (db.num_cameras(), db.num_matched_image_pairs()) == (1, 6)


def test_ctrl_c_cancels_and_waits_for_the_call() -> None:
    finished: list[bool] = []

    def call(cancellation_token) -> None:
        while not cancellation_token.is_cancelled:
            time.sleep(0.01)
        finished.append(True)

    def interrupted() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        colmap.run_interruptible(call, watch=interrupted)
    assert finished
    with pytest.raises(ZeroDivisionError):  # what is raised there reaches the caller
        colmap.run_interruptible(lambda cancellation_token: 1 / 0)


def test_given_poses_stay_and_points_are_metric(own_workspace: Path, views: list[Frame]) -> None:
    result = structure_from_motion(views, replace(CONFIG, poses="capture"), own_workspace)
    assert result.is_metric
    for camera, frame in zip(result.model.cameras, views, strict=True):
        np.testing.assert_allclose(camera.world_from_cam, frame.camera.world_from_cam, atol=1e-12)
    assert np.median(reprojection_distances(result.model)) < 0.4
    # What is seen lies between the object and the wall of the room.
    distance = np.linalg.norm(result.model.points.points_world, axis=1)
    assert 0.08 < np.percentile(distance, 10) < 0.25
    assert 3.8 < np.percentile(distance, 90) < 4.2


def test_cameras_of_their_own_are_kept(views: list[Frame], tmp_path: Path) -> None:
    zoomed = replace(INTRINSICS, fx=306.0, fy=308.0)
    frames = list(views)
    frames[3] = replace(views[3], camera=Camera(zoomed, views[3].camera.world_from_cam))
    images = colmap.ImageSet.of(frames)
    colmap.extract_features(images, CONFIG, 2, tmp_path / "database.db")
    with colmap.quiet_pycolmap().Database.open(tmp_path / "database.db") as db:
        params = {
            image.name: db.read_camera(image.camera_id).params.tolist()
            for image in db.read_all_images()
        }
    assert params["0003.png"] == [306.0, 308.0, 158.0, 123.0]
    assert params["0004.png"] == [300.0, 302.0, 158.0, 123.0]


# What cannot work


def test_two_images_are_too_few(views: list[Frame], tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="2 images, expected at least 3"):
        structure_from_motion(views[:2], CONFIG, tmp_path)


def test_frames_of_the_same_name_are_refused(views: list[Frame], tmp_path: Path) -> None:
    with pytest.raises(DigsError, match=r"share the name '0000'"):
        structure_from_motion([*views, views[0]], CONFIG, tmp_path)


def test_plain_images_are_refused_with_the_reason(tmp_path: Path) -> None:
    frames = []
    for number, pose in enumerate(arc(4)):
        path = tmp_path / f"{number}.png"
        write_image(path, np.full((240, 320, 3), 90, np.uint8))
        frames.append(Frame(path.stem, Camera(INTRINSICS, pose), 0.0, {Layer.IMAGE: path}))
    with pytest.raises(
        DigsError, match=r"0 of 4 images could be placed: 0 features.*too little texture"
    ):
        structure_from_motion(frames, CONFIG, tmp_path / "workspace")


def test_an_image_that_is_none_is_named(views: list[Frame], tmp_path: Path) -> None:
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"no image")
    frames = [*views[:3], replace(views[3], layers={Layer.IMAGE: broken})]
    with pytest.raises(DigsError, match=r"1 of 4 images cannot be read.*broken\.png"):
        structure_from_motion(frames, CONFIG, tmp_path / "workspace")


def test_no_feature_is_sought_where_an_image_is_no_scene(
    views: list[Frame], tmp_path: Path
) -> None:
    frames, half = views[:3], INTRINSICS.width // 2
    unknown = np.zeros((INTRINSICS.height, INTRINSICS.width), np.uint8)
    unknown[:, :half] = 255
    marked = [frames[0].with_layer(Layer.UNKNOWN, unknown), *frames[1:]]
    assert key_of(frames, SfmConfig()) != key_of(marked, SfmConfig())
    images = colmap.ImageSet.of(marked)
    masks = with_scene_masks(marked, images.names, tmp_path / "masks")
    colmap.extract_features(images, SfmConfig(features=300), 1, tmp_path / "database.db", masks)
    with colmap.quiet_pycolmap().Database.open(tmp_path / "database.db") as database:
        by_name = {image.name: image.image_id for image in database.read_all_images()}
        columns = [database.read_keypoints(by_name[name])[:, 0] for name in images.names]
    assert columns[0].min() > half - 1
    assert min(found.min() for found in columns[1:]) < half - 1
    assert with_scene_masks(frames, images.names, tmp_path / "none") is None
