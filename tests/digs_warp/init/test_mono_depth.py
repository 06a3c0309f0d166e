"""Depth by a network, laid over sparse points: a small network that reads depth from the red channel."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import digs_warp as dw
from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud, write_points
from digs_warp.init.mono_depth import (
    DEVIATIONS,
    FEWEST,
    MEANS,
    DepthNetwork,
    SparseView,
    scaled_depth,
    sparse_view,
)
from reference.ball_capture import ball_views, write_capture

NEAREST = 0.5  # [m]: there the red channel is full


def write_network(
    path: Path, kind: str = "inverse", size: tuple[Any, Any] = (60, 80), note: str | None = None
) -> Path:
    """Inverse depth: the red channel as normalized, so with an offset. Metric: 1 / red, so up to a factor."""
    import onnx
    from onnx import TensorProto, helper

    nodes = [helper.make_node("Slice", ["image", "zero", "one", "one"], ["red"])]
    if kind == "inverse":
        nodes.append(helper.make_node("Identity", ["red"], ["depth"]))
    else:
        nodes += [
            helper.make_node("Mul", ["red", "deviation"], ["spread"]),
            helper.make_node("Add", ["spread", "mean"], ["value"]),
            helper.make_node("Reciprocal", ["value"], ["depth"]),
        ]
    constants = [
        *(
            helper.make_tensor(name, TensorProto.INT64, [1], [value])
            for name, value in (("zero", 0), ("one", 1))
        ),
        *(
            helper.make_tensor(name, TensorProto.FLOAT, [1], [value])
            for name, value in (("deviation", DEVIATIONS[0]), ("mean", MEANS[0]))
        ),
    ]
    shape = [1, 3, *size]
    graph = helper.make_graph(
        nodes,
        "depth in red",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("depth", TensorProto.FLOAT, [1, 1, *size])],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 8
    if note is not None:
        helper.set_model_props(model, {"depth": note})
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
    return path


def in_red(depth: np.ndarray) -> np.ndarray:
    """Return an image whose red channel is the inverse depth; the ball shows some texture in the others."""
    red = np.clip(255 * NEAREST / depth, 0, 255)
    return np.stack([red, 0.5 * red + 60, 255 - red], axis=-1).round().astype(np.uint8)


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """A ball in a large sphere whose photographs tell their depth."""
    capture = write_capture(tmp_path_factory.mktemp("ball"), ball_views(12))
    frames = (frame.with_layer(Layer.IMAGE, in_red(frame.load_depth())) for frame in capture.frames)
    return replace(capture, frames=tuple(frames))


@pytest.fixture(scope="module")
def photographs(truth: Capture, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """The same without depth, in another unit than the metre, with sparse points on all surfaces."""
    path = tmp_path_factory.mktemp("points") / "points.ply"
    rng = np.random.default_rng(0)
    points = []
    for frame in truth.frames:
        px = rng.uniform([0, 0], [80, 60], (40, 2))
        depth = frame.load_depth()[px[:, 1].astype(int), px[:, 0].astype(int)]
        points.append(frame.camera.unproject(px.astype(int) + 0.5, depth))
    world = np.concatenate(points)
    write_points(path, PointCloud(world, np.full(world.shape, 0.5)))
    frames = (frame.without_layer(Layer.DEPTH) for frame in truth.frames)
    return replace(truth, frames=tuple(frames), rig=None, points=path)


def median_error(depth: np.ndarray, frame: Frame) -> float:
    true = frame.load_depth()
    return float(np.nanmedian(np.abs(depth - true) / true))


@pytest.mark.parametrize("kind", ["inverse", "metric"])
def test_depth_is_scaled_to_the_sparse_points(
    truth: Capture, photographs: Capture, kind: str, tmp_path: Path
) -> None:
    network = DepthNetwork(write_network(tmp_path / "net.onnx", kind, note=kind), 1)
    assert network.kind == kind
    points = photographs.load_points()
    for frame in truth.frames[:3]:
        view = sparse_view(frame, None, points)
        depth = scaled_depth(network.depth(frame.load_image()), view, network.kind)
        assert depth is not None
        assert depth.dtype == np.float32 and depth.shape == (60, 80)
        # Eight bits of inverse depth are 2.5 % of it at the wall.
        assert median_error(depth, frame) < 0.03


def test_the_unit_is_that_of_the_points(truth: Capture, photographs: Capture) -> None:
    frame = truth.frames[0]
    values = 3.0 / frame.load_depth() - 1.0
    view = sparse_view(frame, None, photographs.load_points())
    depth = scaled_depth(values, SparseView(view.px, 7.0 * view.depth), "inverse")
    assert depth is not None and median_error(depth / 7.0, frame) < 0.01


def test_points_that_something_hides_do_not_change_the_scale(truth: Capture) -> None:
    frame = truth.frames[0]
    rng = np.random.default_rng(1)
    px = np.floor(rng.uniform([0, 0], [80, 60], (200, 2))) + 0.5
    depth = frame.load_depth()[px[:, 1].astype(int), px[:, 0].astype(int)].astype(np.float64)
    depth[:80] *= rng.uniform(1.2, 4.0, 80)  # two of five lie behind what the view shows
    for kind, values in (
        ("metric", 2.0 * frame.load_depth()),
        ("inverse", 3 / frame.load_depth() + 5),
    ):
        found = scaled_depth(values, SparseView(px, depth), kind)  # pyright: ignore[reportArgumentType]
        assert found is not None and median_error(found, frame) < 0.01


def test_too_few_points_give_no_depth(truth: Capture) -> None:
    few = SparseView(np.full((FEWEST - 1, 2), 30.5), np.ones(FEWEST - 1))
    assert scaled_depth(truth.frames[0].load_depth(), few, "metric") is None
    assert scaled_depth(truth.frames[0].load_depth(), few, "inverse") is None


def test_a_map_without_any_relation_gives_no_depth(truth: Capture, photographs: Capture) -> None:
    view = sparse_view(truth.frames[0], None, photographs.load_points())
    assert scaled_depth(np.ones((60, 80), np.float32), view, "inverse") is None
    assert scaled_depth(np.full((60, 80), np.nan, np.float32), view, "metric") is None


def test_photographs_start_from_depth_by_the_network(photographs: Capture, tmp_path: Path) -> None:
    network = write_network(tmp_path / "net.onnx")
    settings: dict[str, Any] = {"mono_depth": network, "mono_depth_kind": "inverse"}
    result = dw.reconstruct(photographs, iterations=3, sh_degree=0, **settings)
    assert result.strategy == "highdepth" and result.start is not None
    assert result.start.because == "points from the depth maps, guessed by net.onnx"
    radii = np.linalg.norm(result.start.points.points_world, axis=1)
    assert np.median(radii) == pytest.approx(0.2, abs=0.02)  # the ball's
    assert result.poses.metric_scale is not None and not result.poses.metric_scale.known
    assert result.training.adherence is None  # nothing was measured
    assert result.frames is not None and not result.frames.training[0].has(Layer.DEPTH)


def test_sizes_that_the_file_leaves_open_follow_the_image(truth: Capture, tmp_path: Path) -> None:
    path = write_network(tmp_path / "net.onnx", size=("height", "width"))
    image = truth.frames[0].load_image()
    open_size = DepthNetwork(path, 1, "inverse").depth(image)
    fixed = DepthNetwork(write_network(tmp_path / "fixed.onnx"), 1, "inverse").depth(image)
    assert open_size.shape == fixed.shape == image.shape[:2]
    assert np.median(np.abs(open_size - fixed)) < 0.02


def test_a_file_that_does_not_say_its_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DigsError, match="--mono-depth-kind with one of inverse, metric"):
        DepthNetwork(write_network(tmp_path / "net.onnx"), 1)
    with pytest.raises(DigsError, match="--mono-depth-kind with one of"):
        DepthNetwork(write_network(tmp_path / "net.onnx", note="relative"), 1)


def test_other_files_are_refused(tmp_path: Path) -> None:
    broken = tmp_path / "net.onnx"
    broken.write_bytes(b"no network")
    with pytest.raises(DigsError, match="not a network that onnxruntime can load"):
        DepthNetwork(broken, 1, "inverse")
    with pytest.raises(DigsError, match=r"depth network .*missing"):
        DepthNetwork(tmp_path / "missing.onnx", 1, "inverse")


def test_recordings_with_depth_need_no_network(truth: Capture, tmp_path: Path) -> None:
    network = write_network(tmp_path / "net.onnx", note="inverse")
    with pytest.raises(DigsError, match="has depth maps, which are better"):
        dw.reconstruct(truth, mono_depth=network)


def test_a_kind_without_a_network_is_refused(photographs: Capture) -> None:
    with pytest.raises(DigsError, match="needs --mono-depth"):
        dw.reconstruct(photographs, mono_depth_kind="inverse")
