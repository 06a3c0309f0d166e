"""What the quality report says of models that are made by hand, and which models are refused."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.sfm_model import Observations, SfmModel
from digs_warp.device.libraries import import_pycolmap
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.poses.from_images.colmap import ImageSet, extract_features
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.poses.from_images.image_pairs import loop_pairs, sequential_pairs, vlad
from digs_warp.poses.from_images.quality import (
    SfmQuality,
    check_agreement,
    check_completeness,
    check_motion,
)
from digs_warp.poses.from_images.workspace import (
    FILES,
    is_complete,
    key_of,
    with_image_files,
    write_model,
)
from reference.full_disk import largest_file, small_disk
from reference.noise_capture import write_capture
from reference.sfm_views import arc, record

UP = np.array([0.0, 0.0, 1.0])
GOOD = SfmQuality(
    images=100, registered=100, models=1, points=5000, observations_per_image=200.0,
    track_length=4.0, reprojection_error_px=0.2,
)  # fmt: skip


def model_from(eyes: np.ndarray, points: np.ndarray) -> SfmModel:
    """Every camera looks along x and sees every point."""
    intrinsics = Intrinsics.from_fov(640, 480, 60.0)
    cameras = tuple(Camera(intrinsics, look_at(eye, eye + [1.0, 0.0, 0.0], UP)) for eye in eyes)
    who, what = np.meshgrid(np.arange(len(eyes)), np.arange(len(points)), indexing="ij")
    px = np.concatenate([camera.project(points)[0] for camera in cameras])
    return SfmModel(
        tuple(f"{i:04d}" for i in range(len(eyes))),
        cameras,
        PointCloud(points, np.zeros_like(points)),
        Observations(who.ravel(), what.ravel(), px),
        np.arange(len(points), dtype=np.float32),
    )


POINTS = np.array([[2.0, y, z] for y in (-0.3, 0.0, 0.3) for z in (-0.3, 0.3)])


def test_models_with_too_few_of_the_images_are_refused(caplog: pytest.LogCaptureFixture) -> None:
    check_completeness(GOOD, min_registered=1.0)
    assert caplog.text == ""
    check_completeness(replace(GOOD, registered=93, models=2), min_registered=0.9)
    assert "93 of 100 images" in caplog.text
    said = r"largest of 3 models holds 48 of 100.*--min-registered 0\.48"
    with pytest.raises(DigsError, match=said):
        check_completeness(replace(GOOD, registered=48, models=3), min_registered=0.9)


def test_given_poses_with_few_points_are_refused_unless_matches_agree_with_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    frames = record(arc(4, 60.0), tmp_path).frames
    turned = [replace(f, camera=replace(f.camera, world_from_cam=p)) for f, p in _exchanged(frames)]
    few = replace(GOOD, points=30, observations_per_image=0.6)
    check_agreement(GOOD, turned)
    check_agreement(few, frames)
    assert "of their matches agree with the poses" in caplog.text
    for wrong in (turned, []):
        with pytest.raises(DigsError, match="share only 30 points"):
            check_agreement(few, wrong)


def _exchanged(frames: Sequence[Frame]) -> list[tuple[Frame, np.ndarray]]:
    """Each frame with the pose of another one."""
    return [
        (frames[i], frames[j].camera.world_from_cam) for i, j in ((0, 2), (1, 0), (2, 3), (3, 1))
    ]


def test_cameras_on_a_straight_line_are_refused() -> None:
    eyes = np.stack([np.zeros(9), np.linspace(-0.5, 0.5, 9), np.zeros(9)], axis=1)
    with pytest.raises(DigsError, match="straight line"):
        check_motion(model_from(eyes, POINTS))
    eyes[:, 2] = 0.05 * np.linspace(-1, 1, 9) ** 2  # a hand is never as straight
    check_motion(model_from(eyes, POINTS))


def test_cameras_that_only_turned_are_refused() -> None:
    eyes = 0.005 * np.random.default_rng(0).normal(size=(9, 3))
    with pytest.raises(DigsError, match="turned on the spot"):
        check_motion(model_from(eyes, POINTS))
    check_motion(model_from(20 * eyes, POINTS))


def test_images_in_memory_get_files_with_the_same_bytes(tmp_path: Path) -> None:
    stored = write_capture(tmp_path / "capture").frames
    in_memory = [replace(f, layers={Layer.IMAGE: f.load_image()}) for f in stored]
    written = with_image_files(in_memory, tmp_path / "images")
    assert {frame.path(Layer.IMAGE).parent for frame in written} == {tmp_path / "images"}
    for frame, there in zip(written, stored, strict=True):
        np.testing.assert_array_equal(frame.load_image(), there.load_image())
    assert key_of(written, SfmConfig()) == key_of(stored, SfmConfig())


def test_images_with_files_stay_where_they_are(tmp_path: Path) -> None:
    stored = write_capture(tmp_path / "capture").frames
    assert with_image_files(stored, tmp_path / "images") == list(stored)
    assert not (tmp_path / "images").exists()


def test_colmap_is_not_called_without_room_for_its_database(tmp_path: Path) -> None:
    """It would end the process."""
    images = ImageSet(tmp_path, ("a.png",), (Intrinsics.from_fov(32, 24, 60.0),))
    with small_disk(tmp_path / "disk", 1 << 20) as folder:
        with pytest.raises(DigsError, match=r"database\.db': cannot be written .*needs 17"):
            extract_features(images, SfmConfig(), 1, folder / "database.db")
        assert list(folder.iterdir()) == []


def test_a_model_that_does_not_fit_on_the_disk_leaves_the_old_one(tmp_path: Path) -> None:
    pycolmap = import_pycolmap()
    options = pycolmap.SyntheticDatasetOptions()
    options.num_points3D = 50
    model = pycolmap.synthesize_dataset(options)
    folder = tmp_path / "model"
    write_model(model, folder)
    before = {name: (folder / name).read_bytes() for name in FILES}
    largest = max(map(len, before.values()))
    for size in (0, 1, 100, len(before["points3D.bin"]) - 1, largest // 2, largest - 1):
        with largest_file(size), pytest.raises(DigsError, match=r"cannot be written .*Free space"):
            write_model(model, folder)
        assert {name: (folder / name).read_bytes() for name in FILES} == before
        assert list(tmp_path.iterdir()) == [folder]
    (folder / "rigs.bin").unlink()
    assert not is_complete(folder)
    write_model(model, folder)
    assert is_complete(folder)


def test_sequential_pairs_reach_neighbors_and_powers_of_two() -> None:
    pairs = sequential_pairs(100, overlap=5)
    assert {j for i, j in pairs if i == 0} == {1, 2, 3, 4, 5, 8, 16, 32}
    assert {j for i, j in pairs if i == 98} == {99}
    assert len(pairs) == len(set(pairs))


def places(visits: list[int], seed: int = 0) -> list[np.ndarray]:
    """Descriptors of images that show numbered places: those of the same place differ by noise only."""
    rng = np.random.default_rng(seed)
    looks = rng.integers(0, 256, (max(visits) + 1, 60, 128))
    return [
        np.clip(looks[place] + rng.normal(0, 8, (60, 128)), 0, 255).astype(np.uint8)
        for place in visits
    ]


def test_a_walk_that_comes_back_gets_its_loop() -> None:
    visits = [*range(12), *range(12)]  # twice round the same twelve places
    pairs = loop_pairs(places(visits), per_image=1, min_gap=12)  # just far enough apart
    assert pairs == [(i, i + 12) for i in range(12)]


def test_neighbors_and_images_without_features_get_no_partner() -> None:
    descriptors = places([0, 1, 2, 3, 4, 0])
    descriptors[4] = np.zeros((0, 128), np.uint8)
    pairs = loop_pairs(descriptors, per_image=5, min_gap=3)
    assert all(j - i >= 3 for i, j in pairs)
    assert all(4 not in pair for pair in pairs)
    assert (0, 5) in pairs
    assert loop_pairs(descriptors, per_image=0, min_gap=1) == []
    assert loop_pairs(descriptors[:1], per_image=5, min_gap=1) == []


def test_vlad_is_the_sum_of_differences_to_the_nearest_word() -> None:
    words = np.array([[0.0, 0.0], [10.0, 0.0]], np.float32)
    descriptors = [np.array([[1.0, 0.0], [0.0, 1.0], [10.0, 2.0]])]
    # Word 0 gets (1, 0) + (0, 1), word 1 gets (0, 2); each is normalized, then the whole.
    root = np.sqrt(0.5)
    expected = np.array([root, root, 0.0, 1.0]) * root
    np.testing.assert_allclose(vlad(descriptors, words)[0], expected, atol=1e-6)
