"""A reconstruction in its folder: what is saved is loaded, and what is broken is named."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import FIELDS
from digs_warp.init.config import InitConfig
from digs_warp.masks.config import SegmentConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.train.config import Stop, TrainConfig
from reference.tiny_capture import write_tiny_capture

CONFIG = ReconstructConfig(
    init=InitConfig(voxel_size=0.02),
    segment=SegmentConfig(masks="depth"),
    train=TrainConfig(stop=Stop(iterations=10), sh_degree=0, keep_course=True),
)


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("run") / "capture", frames=9)


@pytest.fixture(scope="module")
def result(capture: Capture) -> Reconstruction:
    return reconstruct(capture, CONFIG, capture.folder.parent / "reconstruction")


def assert_same(one: Reconstruction, other: Reconstruction) -> None:
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(one.gaussians, name), getattr(other.gaussians, name))
    assert one.frames is not None and other.frames is not None
    for (a, a_held_out), (b, b_held_out) in zip(
        one.frames.by_time, other.frames.by_time, strict=True
    ):
        assert (a.name, a_held_out) == (b.name, b_held_out)
        np.testing.assert_array_equal(a.camera.world_from_cam, b.camera.world_from_cam)
        np.testing.assert_array_equal(a.load_mask(), b.load_mask())
    assert one.start is not None and other.start is not None
    np.testing.assert_array_equal(one.start.points.points_world, other.start.points.points_world)
    assert (one.start.sources, one.start.depth) == (other.start.sources, other.start.depth)
    # NaN does not equal itself, so compare as text.
    assert str(one.scores.views) == str(other.scores.views)
    assert str(one.course) == str(other.course)
    for name in ("capture", "settings", "seconds", "results", "figures"):
        assert getattr(one, name) == getattr(other, name), name
    assert len(one.load_snapshots()) == len(other.load_snapshots()) == 2


def test_a_result_is_what_its_folder_holds(result: Reconstruction) -> None:
    assert result.folder is not None
    assert_same(Reconstruction.load(result.folder), result)
    assert (result.strategy, result.masks) == ("highdepth", "depth")
    assert result.course[-1].score == result.scores.mean
    assert result.training.iterations == 10


def test_a_saved_copy_needs_nothing_of_the_first_folder(
    result: Reconstruction, tmp_path: Path
) -> None:
    assert result.folder is not None
    original = Path(shutil.copytree(result.folder, tmp_path / "original"))
    copy = Reconstruction.load(original).save(tmp_path / "copy")
    shutil.rmtree(original)
    assert_same(copy, result)
    assert_same(Reconstruction.load(tmp_path / "copy"), result)
    name = result.scores.views[0].name
    assert copy.load_render(name, (54, 72, 3)).any()


@pytest.mark.parametrize(
    "name", ["evaluation.json", "training.jsonl", "gaussians.npz", "run.json", "cameras.json"]
)
def test_broken_and_missing_files_are_named(
    capture: Capture, result: Reconstruction, tmp_path: Path, name: str
) -> None:
    assert result.folder is not None
    path = Path(shutil.copytree(result.folder, tmp_path / "copy")) / name
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(DigsError, match=re.escape(name)):
        Reconstruction.load(path.parent, capture)
    path.unlink()
    if name != "cameras.json":  # older than the file: the recording's own poses
        with pytest.raises(DigsError, match=re.escape(name)):
            Reconstruction.load(path.parent, capture)
    if name not in ("gaussians.npz", "cameras.json"):
        assert len(Reconstruction.load(path.parent, partial=True).gaussians)
