"""Depth from a network for frames that have none, laid over the sparse points of each view.

What a network guesses is right up to a factor that differs from image to image, and inverse depth also up to
an offset. The sparse points that a view sees tell both. Points that something hides are outliers, so the
factor is the most probable ratio, as that between structure from motion and depth is (paper eq. 7).
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.sfm_model import SfmModel
from digs_warp.device.libraries import open_network
from digs_warp.device.threads import default_threads
from digs_warp.init.config import DepthKind, MonoDepthConfig
from digs_warp.init.local_scales import depth_at
from digs_warp.init.scale import estimate_scale
from digs_warp.record.progress import progress
from digs_warp.words import counted

logger = logging.getLogger(__name__)

# The file's own metadata may say which kind its depth is.
KIND_KEY = "depth"

MEANS, DEVIATIONS = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])

# Where the file leaves the size open: the longer side and the multiple of which sides are (patches of ViTs).
LONGER_SIDE, PATCH = 518, 14

_WHAT = "depth network"


class DepthNetwork:
    """A loaded network.

    Args:
        path: an ONNX file with one image input (1, 3, height, width), whose height and width may be open,
            and a map as its first output: (height, width) but for dimensions of 1.
        threads: cores it may use.
        kind: what the map holds; None: as the file's metadata say.

    Raises:
        DigsError: no such file, not a network of that form, or nothing says of which kind it is.
    """

    def __init__(self, path: Path, threads: int, kind: DepthKind | None = None) -> None:
        require_file(path, _WHAT, "Name an ONNX file with --mono-depth")
        self._path = path
        self._session = open_network(path, threads, _WHAT, "export it again as ONNX")
        self.kind: DepthKind = kind or self._kind_in_file()
        inputs = self._session.get_inputs()
        shape = list(inputs[0].shape)
        if len(inputs) != 1 or len(shape) != 4 or shape[1] != 3:
            found = ", ".join(f"{each.name} {each.shape}" for each in inputs)
            raise DigsError(
                f"{_WHAT} '{path}': inputs {found}, expected one image of (1, 3, height, width); export the "
                "network alone, without its preprocessing"
            )
        self._name: str = inputs[0].name
        self._size = shape[2:]

    def depth(self, image: np.ndarray) -> np.ndarray:
        """Return the map of an sRGB image (height, width, 3) uint8: (height, width), float32."""
        from PIL import Image

        height, width = image.shape[:2]
        rows, columns = self._input_size(width, height)
        resized = Image.fromarray(image).resize((columns, rows), Image.Resampling.BICUBIC)
        values = (np.asarray(resized, dtype=np.float64) / 255 - MEANS) / DEVIATIONS
        values = values.transpose(2, 0, 1)[None].astype(np.float32)
        found = np.squeeze(self._run(values))
        if found.ndim != 2:
            raise DigsError(
                f"{_WHAT} '{self._path}': its first output has shape {found.shape}, expected one map"
            )
        back = Image.fromarray(found.astype(np.float32))
        return np.asarray(back.resize((width, height), Image.Resampling.BILINEAR))

    def _run(self, values: np.ndarray) -> np.ndarray:
        try:
            return np.asarray(self._session.run(None, {self._name: values})[0])
        except Exception as error:  # onnxruntime's errors share no base class but Exception
            raise DigsError(
                f"{_WHAT} '{self._path}': cannot run on an image of {values.shape} ({error}); export "
                "it with a fixed size"
            ) from error

    def _input_size(self, width: int, height: int) -> tuple[int, int]:
        """Return height and width of the input; open ones keep the shape of the image."""
        shrink = LONGER_SIDE / max(width, height)
        fitting = [PATCH * max(1, round(side * shrink / PATCH)) for side in (height, width)]
        rows, columns = (
            size if isinstance(size, int) and size > 0 else open_size
            for size, open_size in zip(self._size, fitting, strict=True)
        )
        return rows, columns

    def _kind_in_file(self) -> Any:
        found = self._session.get_modelmeta().custom_metadata_map.get(KIND_KEY)
        kinds = get_args(DepthKind)
        if found not in kinds:
            raise DigsError(
                f"{_WHAT} '{self._path}': nothing says whether it gives inverse or metric depth; add "
                f"--mono-depth-kind with one of {', '.join(kinds)}"
            )
        return found


# Points below which a view's depth cannot be scaled.
FEWEST = 20

# RANSAC for the line through points of inverse depth: pairs tried, and the largest distance of an inlier from
# the line [share of the spread].
TRIALS, NEAR = 500, 0.02


def check_mono_depth(capture: Capture, config: MonoDepthConfig) -> None:
    """Raise a `DigsError` when the file is missing, or the recording has depth."""
    if config.mono_depth is None:
        return
    require_file(config.mono_depth, "depth network", "Name an ONNX file with --mono-depth")
    if capture.has_depth:
        raise DigsError(f"--mono-depth: {capture} has depth maps, which are better; leave it out")


def guessed_depth(
    frames: Sequence[Frame],
    config: MonoDepthConfig,
    sfm: SfmModel | None,
    recorded: PointCloud | None,
) -> list[Frame]:
    """Return the frames with the depth of the configured network.

    Args:
        frames: with images.
        config: names the network.
        sfm: sparse points, and which frame saw them.
        recorded: sparse points of the recording, for frames that ``sfm`` does not have.

    Raises:
        DigsError: as of `DepthNetwork` and `with_mono_depth`.
    """
    assert config.mono_depth is not None
    network = DepthNetwork(config.mono_depth, default_threads(), config.mono_depth_kind)
    views = {frame.name: sparse_view(frame, sfm, recorded) for frame in frames}
    return with_mono_depth(frames, views, network)


@dataclass(frozen=True, eq=False)
class SparseView:
    """The sparse points that a view sees: pixels (u, v), (n, 2), and depths in the poses' unit, (n,)."""

    px: np.ndarray
    depth: np.ndarray


def sparse_view(frame: Frame, sfm: SfmModel | None, points: PointCloud | None) -> SparseView:
    """Return the points that a frame observed, or those of a recording that lie in its image."""
    if sfm is not None and frame.name in sfm.names:
        index = sfm.names.index(frame.name)
        seen = sfm.observations.cameras == index
        cloud = sfm.points.points_world[sfm.observations.points[seen]]
    else:
        cloud = points.points_world if points is not None else np.zeros((0, 3))
    px, depth = frame.camera.project(cloud)
    shown = frame.camera.shows(px, depth)
    return SparseView(px[shown], depth[shown])


def with_mono_depth(
    frames: Sequence[Frame], views: Mapping[str, SparseView], network: DepthNetwork
) -> list[Frame]:
    """Return the frames with depth from the network; those that see too few points are left out.

    Args:
        frames: with images.
        views: the sparse points of each, by name.
        network: what guesses.

    Raises:
        DigsError: no frame sees enough points.
    """
    found = []
    with progress(len(frames), "Guessing depth", "frame") as bar:
        for frame in frames:
            depth = scaled_depth(network.depth(frame.load_image()), views[frame.name], network.kind)
            if depth is not None:
                found.append(frame.with_layer(Layer.DEPTH, depth))
            bar.update()
    if not found:
        raise DigsError(
            f"--mono-depth: no view of {counted(len(frames), 'frame')} sees {FEWEST} sparse points that fit "
            "its depth, so nothing tells its scale; check --mono-depth-kind, or leave it out"
        )
    if len(found) < len(frames):
        logger.warning(
            "--mono-depth: %d of %d frames see too few sparse points and give no depth",
            *(len(frames) - len(found), len(frames)),
        )
    return found


def scaled_depth(values: np.ndarray, view: SparseView, kind: DepthKind) -> np.ndarray | None:
    """Return a network's map as depth in the unit of the sparse points, NaN where it is none.

    Args:
        values: depth, or inverse depth, as the network gives it, (height, width).
        view: the sparse points; some may be hidden.
        kind: what the map holds.

    Returns:
        (height, width), float32; None: too few points, or they do not fit the map at all.
    """
    if kind == "inverse":
        offset = _offset(depth_at(values, view.px), view.depth)
        if offset is None:
            return None
        above = values - np.float32(offset)
        with np.errstate(divide="ignore"):
            values = np.where(above > 0, 1.0 / above, np.nan)
    depth = np.where(np.isfinite(values) & (values > 0), values, np.nan).astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = view.depth / depth_at(depth, view.px)
    ratios = ratios[np.isfinite(ratios)]
    if len(ratios) < FEWEST:
        return None
    return depth * np.float32(estimate_scale(ratios).sfm_per_metre)


def _offset(values: np.ndarray, depth: np.ndarray) -> float | None:
    """Return b of the line values = a / depth + b, a > 0, on which most points lie (MSAC)."""
    known = np.isfinite(values)
    x, y = 1.0 / depth[known], values[known].astype(np.float64)
    if len(x) < FEWEST:
        return None
    pairs = np.random.default_rng(0).integers(len(x), size=(TRIALS, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.diff(y[pairs], axis=1)[:, 0] / np.diff(x[pairs], axis=1)[:, 0]
    usable = np.isfinite(slopes) & (slopes > 0)
    if not usable.any():
        return None
    slopes, first = slopes[usable], pairs[usable, 0]
    offsets = y[first] - slopes * x[first]
    spread = np.subtract(*np.percentile(y, [95, 5]))
    apart = np.abs(y - (slopes[:, None] * x + offsets[:, None])) / max(NEAR * spread, 1e-30)
    best = apart[np.argmin(np.minimum(apart, 1.0).sum(axis=1))] <= 1.0
    if best.sum() < FEWEST:
        return None
    slope, offset = np.polyfit(x[best], y[best], 1)
    return float(offset) if slope > 0 else None
