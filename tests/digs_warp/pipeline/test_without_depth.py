"""Photographs with poses and without depth: which points the reconstruction starts from."""

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import digs_warp as dw
from digs_warp.data.capture import Capture
from digs_warp.data.layers import Layer
from digs_warp.formats.captures.formats import export_capture, read_recording
from digs_warp.formats.captures.to_capture import write_capture
from digs_warp.init.config import StrategyChoice
from digs_warp.pipeline.reconstruction import Reconstruction
from reference.tiny_capture import write_tiny_capture

# One pass over the views: the start decides the quality.
QUICK: dict[str, Any] = {"iterations": 40, "sh_degree": 0}


@pytest.fixture(scope="module")
def with_depth(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return write_tiny_capture(tmp_path_factory.mktemp("tiny"))


@pytest.fixture(scope="module")
def photographs(with_depth: Capture) -> Capture:
    """The same with photographs, masks and poses alone."""
    frames = (frame.without_layer(Layer.DEPTH) for frame in with_depth.frames)
    return replace(with_depth, frames=tuple(frames))


def without_masks(capture: Capture) -> Capture:
    frames = (frame.without_layer(Layer.MASK) for frame in capture.frames)
    return replace(capture, frames=tuple(frames))


@pytest.fixture(scope="module")
def from_colmap(with_depth: Capture, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """A COLMAP workspace read back: photographs, poses and points; no depth, no masks."""
    folder = tmp_path_factory.mktemp("colmap")
    export_capture(with_depth, "colmap", folder / "workspace")
    recording = read_recording(folder / "workspace", "colmap")
    return without_masks(write_capture(recording, "colmap", folder / "capture"))


@pytest.mark.parametrize(
    ("strategy", "source", "because"),
    [
        (None, "depth", "depth that matching the photographs tells"),
        ("hull", "hull", "the visual hull of the masks; the recording has no depth"),
    ],
)
def test_an_object_starts_from_its_photographs(
    strategy: StrategyChoice | None,
    source: str,
    because: str,
    with_depth: Capture,
    photographs: Capture,
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.INFO):
        result = dw.reconstruct(photographs, strategy=strategy, **QUICK)
    assert result.strategy == (strategy or "mvs") and result.start is not None
    assert set(result.start.sources) == {source}
    assert because in caplog.text
    best = dw.reconstruct(with_depth, **QUICK)
    assert result.scores.mean.psnr_object > best.scores.mean.psnr_object - 4.0


def test_a_model_of_colmap_gives_the_points(from_colmap: Capture, tmp_path: Path) -> None:
    result = dw.reconstruct(from_colmap, tmp_path / "out", strategy="default", **QUICK)
    points = from_colmap.load_points()
    assert points is not None and result.start is not None and result.poses.sfm is None
    assert result.strategy == "default"
    assert result.start.sources["recorded"] == len(points)
    assert result.settings["train"]["density"]["strategy"] == "adaptive"
    loaded = Reconstruction.load(tmp_path / "out")
    assert loaded.start is not None
    assert loaded.start.because == "the sparse points of the recording, which has no depth"


def test_matching_needs_no_sparse_points(
    photographs: Capture, caplog: pytest.LogCaptureFixture
) -> None:
    result = dw.reconstruct(without_masks(photographs), **QUICK)
    assert result.strategy == "mvs" and result.start is not None
    assert set(result.start.sources) == {"depth", "shell"}
    assert result.settings["train"]["density"]["strategy"] == "fixed"
    assert "share only 0 points" in caplog.text
