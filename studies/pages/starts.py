"""docs/images/initialization.jpg: the points of the five initializations on four objects, beside the truth.

It takes recordings from `digs-warp study run initialization`, in out/study/initialization, and makes what is
missing; estimating the poses takes a minute or two per object. The simulator draws the truth.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import FrameImages
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera
from digs_warp.measure.surface_metrics import surface_score
from digs_warp.pipeline.front_end import front_end
from digs_warp.pipeline.reconstruct import ReconstructConfig
from digs_warp.record.run_log import RunLog
from digs_warp.show.report.pictures import over_white
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.sensor_plan import make_plan
from digs_warp.sim.record.session import prepare_session
from digs_warp.study.catalogue import find_study
from digs_warp.study.engine.case import Case, with_settings
from digs_warp.study.engine.chain import SURFACE_THRESHOLD, record_case
from digs_warp.surface.true_surface import read_true_surface
from scripts.page_marks import DOCS
from studies.pages import save_figure

OBJECTS = ("ycb_mustard_bottle", "avocado", "spot", "armchair")
STRATEGIES = ("default", "random", "depth", "highdepth", "fusion")
FRAME = 5  # all panels are seen from the camera of this frame
SIZE = (1440, 810)  # of the drawing before it is cropped to the object [px]
MARGIN = 0.12  # of the object's size, around it
DOT_PX = 2  # a point covers this many pixels to either side
HIDDEN = 0.03  # a point this far [m] behind what the camera truly sees is hidden
PANEL = 2.35  # [inch]


def main() -> None:
    """Record, estimate the poses and initialize; draw."""
    study = find_study("initialization")
    cases = {
        (case.labels["object"], case.labels["strategy"]): case
        for case in reversed(study.cases(study.objects, 1, study.iterations))
    }
    columns = len(STRATEGIES) + 1
    figure = Figure(figsize=(columns * PANEL, len(OBJECTS) * (PANEL + 0.5)), dpi=110)
    axes = figure.subplots(len(OBJECTS), columns)
    for row, name in zip(axes, OBJECTS, strict=True):
        truth = true_view(cases[name, STRATEGIES[0]])
        assert truth.mask is not None and truth.depth_true is not None  # the simulator knows both
        window = window_around(truth.mask)
        for axis, strategy in zip(row, STRATEGIES, strict=False):
            capture, camera, points = start_of(cases[name, strategy], study.folder)
            picture = points_picture(points, camera, DOT_PX, truth.depth_true)
            show(axis, picture[window], strategy, caption(points, capture))
        object_name = name.removeprefix("ycb_").replace("_", " ")
        show(row[-1], over_white(truth.image, truth.mask)[window], "truth", object_name)
    figure.subplots_adjust(0.004, 0.045, 0.996, 0.965, wspace=0.03, hspace=0.28)
    save_figure(figure, DOCS / "images" / "initialization.jpg", 78)


def start_of(case: Case, folder: Path) -> tuple[Capture, Camera, PointCloud]:
    """Return the recording of a case, its camera as posed, and the points to start from."""
    capture = record_case(case, folder)
    config = with_settings(ReconstructConfig(), case.reconstruction)
    with tempfile.TemporaryDirectory() as work:
        prepared = front_end(capture, config, Path(work), RunLog("reconstruct", config))
    posed = prepared.poses.posed
    cameras = {frame.name: frame.camera for frame in (*posed.training, *posed.held_out)}
    return capture, cameras[capture.frames[FRAME].name].resized(*SIZE), prepared.start.points


def true_view(case: Case) -> FrameImages:
    """Return the frame, drawn by a perfect camera of `SIZE`."""
    width, height = SIZE
    config = replace(
        with_settings(SimulateConfig(), case.recording), width=width, height=height, tier="truth"
    )
    session = prepare_session(config, load_inputs(config))
    maker = FrameMaker(session, make_plan(session))
    return maker.finish(maker.render(FRAME), {})


def window_around(mask: np.ndarray) -> tuple[slice, slice]:
    """Return rows and columns of a square around the object, within the image."""
    rows, columns = np.nonzero(mask > 127)
    side = int((1 + 2 * MARGIN) * max(np.ptp(rows), np.ptp(columns)))
    side = min(side, *mask.shape)
    top, left = (
        int(np.clip((places.min() + places.max() - side) // 2, 0, size - side))
        for places, size in zip((rows, columns), mask.shape, strict=True)
    )
    return slice(top, top + side), slice(left, left + side)


def caption(points: PointCloud, capture: Capture) -> str:
    """Return the number of points, and how they lie to the true surface."""
    surface = read_true_surface(capture.folder)
    assert surface is not None  # it was simulated
    score = surface_score(points.points_world, surface, SURFACE_THRESHOLD)
    return (
        f"{len(points):,} points, {score.precision:.0%} on it\n"
        f"cover {score.recall:.0%}, spacing {score.spacing_ratio:.2f}"
    )


def points_picture(
    points: PointCloud, camera: Camera, dot: int, depth_true: np.ndarray | None = None
) -> np.ndarray:
    """Draw the points as the camera sees them, near ones over far ones, on white.

    Args:
        points: with colors.
        camera: gives the size of the picture.
        dot: a point covers this many pixels to either side.
        depth_true: of the camera [m]. Points behind it are left out: through gaps between points one would
            see the far side.
    """
    width, height = camera.intrinsics.width, camera.intrinsics.height
    picture = np.ones((height, width, 3))
    px, depth = camera.project(points.points_world)
    order = np.argsort(-depth)
    order = order[depth[order] > 0]
    columns, rows = np.floor(px[order]).astype(np.int64).T
    if depth_true is not None:
        seen = depth_true[rows.clip(0, height - 1), columns.clip(0, width - 1)]
        visible = ~(depth[order] > seen + HIDDEN)  # where nothing is, nothing hides
        order, columns, rows = order[visible], columns[visible], rows[visible]
    for down in range(-dot, dot + 1):
        for right in range(-dot, dot + 1):
            u, v = columns + right, rows + down
            inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
            picture[v[inside], u[inside]] = points.colors[order][inside]
    return picture


def show(axis: Axes, picture: np.ndarray, title: str, below: str) -> None:
    """Put a picture, its title and the words below it into a panel."""
    axis.imshow(picture)
    axis.set_title(title, fontsize=13, pad=4)
    axis.set_xlabel(below, fontsize=10.5, labelpad=3)
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_color("0.8")
