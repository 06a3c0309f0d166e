"""The whole way in memory gives what it gives on disk, and leaves nothing behind."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.data.gaussians import FIELDS
from reference.sfm_views import arc, record

FRAMES = 6
RECORDING: dict[str, Any] = {"frames": FRAMES, "width": 96}
# Depth is segmented and initialized from, half the images are held out: every layer and folder is used.
SETTINGS: dict[str, Any] = {"iterations": 12, "masks": "depth", "voxel_size": 0.02, "test_every": 2}


@pytest.fixture(scope="module")
def recording() -> dw.Capture:
    return dw.simulate(**RECORDING)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dw.simulate(**RECORDING, out=tmp_path_factory.mktemp("front-door") / "capture").folder


def same(one: dw.Gaussians, other: dw.Gaussians) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in FIELDS)


def test_memory_and_folder_give_the_same_gaussians_and_only_out_is_left(
    recording: dw.Capture, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    in_memory = dw.reconstruct(recording, **SETTINGS)
    assert list(temporary.iterdir()) == []
    on_disk = dw.reconstruct(str(folder), out=tmp_path / "out", **SETTINGS)
    assert list(temporary.iterdir()) == []
    assert same(in_memory.gaussians, on_disk.gaussians) and len(on_disk.gaussians) > 50
    assert in_memory.scores.views == on_disk.scores.views and in_memory.folder is None
    assert in_memory.frames and on_disk.frames
    for here, there in zip(in_memory.frames.training, on_disk.frames.training, strict=True):
        np.testing.assert_array_equal(here.load_mask(), there.load_mask())
    loaded = dw.load(tmp_path / "out")
    assert isinstance(loaded, dw.Reconstruction)
    assert same(loaded.gaussians, on_disk.gaussians) and loaded.scores.views == on_disk.scores.views


def test_structure_from_motion_reads_images_in_memory(tmp_path: Path) -> None:
    stored = record(arc(6), tmp_path / "capture")
    frames = [
        replace(
            frame,
            layers={
                dw.Layer.IMAGE: frame.load_image(),
                dw.Layer.DEPTH: frame.load_depth(),
                dw.Layer.MASK: frame.load_mask(),
            },
        )
        for frame in stored.frames
    ]
    capture = replace(stored, stored_in=None, frames=tuple(frames))
    out = tmp_path / "out"
    result = dw.reconstruct(capture, out, strategy="default", features=1500, iterations=0)
    assert len(result.gaussians) > 20
    assert len(list((out / "sfm" / "images").iterdir())) == len(capture)


def test_the_stream_is_the_recording(recording: dw.Capture) -> None:
    frames = dw.stream(**RECORDING)
    for _, stored in zip(range(2), recording.frames, strict=False):
        frame = next(frames)
        np.testing.assert_array_equal(frame.left, stored.load_image())
        np.testing.assert_array_equal(frame.depth, stored.load_depth())
