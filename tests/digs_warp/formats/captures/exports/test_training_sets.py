"""Captures as HDF5 with BlenderProc's keys and as shards of WebDataset, read back by their own libraries."""

import json
from pathlib import Path

import numpy as np
import pytest

from digs_warp.data.capture import Capture
from digs_warp.formats.captures import training_sets
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL
from reference.exported import exported
from reference.labeled_capture import labeled_capture


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return labeled_capture(tmp_path_factory.mktemp("pairs") / "capture")


def test_h5py_reads_what_blenderproc_would_write(
    capture: Capture, pairs: Capture, tmp_path: Path
) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: extra hdf5")
    folder = exported(capture, "hdf5", tmp_path / "one")
    for number, frame in enumerate(capture.frames):
        with h5py.File(folder / f"{number}.hdf5") as file:
            np.testing.assert_array_equal(file["colors"], frame.load_image())
            np.testing.assert_array_equal(file["depth"], np.nan_to_num(frame.load_depth()))
            inside = frame.load_mask() > 127
            np.testing.assert_array_equal(file["instance_segmaps"], inside)
            (camera,) = json.loads(file["campose"][()])
        pose = np.array(camera["cam2world_matrix"]) @ OPENCV_FROM_OPENGL
        np.testing.assert_allclose(pose, frame.camera.world_from_cam, atol=1e-12)
        np.testing.assert_array_equal(camera["cam_K"], frame.camera.intrinsics.matrix)
    with h5py.File(exported(pairs, "hdf5", tmp_path / "two") / "1.hdf5") as file:
        left, right = np.array(file["colors"])
    np.testing.assert_array_equal(left, pairs.frames[1].load_image())
    np.testing.assert_array_equal(right, pairs.frames[1].load_right_image())


def test_webdataset_reads_the_shards(
    pairs: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wds = pytest.importorskip("webdataset", reason="webdataset is not installed")
    monkeypatch.setattr(training_sets, "FRAMES_PER_SHARD", 2)
    folder = exported(pairs, "webdataset", tmp_path)
    shards = [str(path) for path in sorted(folder.glob("*.tar"))]
    assert len(shards) == 2
    samples = list(wds.WebDataset(shards, shardshuffle=False).decode("rgb8"))
    assert [sample["__key__"] for sample in samples] == ["0000", "0001", "0002"]
    for sample, frame in zip(samples, pairs.frames, strict=True):
        np.testing.assert_array_equal(sample["image.png"], frame.load_image())
        np.testing.assert_array_equal(sample["right.png"], frame.load_right_image())
        np.testing.assert_array_equal(sample["depth.npy"], np.nan_to_num(frame.load_depth()))
        np.testing.assert_array_equal(sample["mask.png"][..., 0], frame.load_mask())
        facts = sample["json"]
        np.testing.assert_allclose(facts["cam2world_matrix"], frame.camera.world_from_cam)
        assert facts["time"] == frame.time
