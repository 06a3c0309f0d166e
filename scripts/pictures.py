"""Draw the pictures of the documentation that show results of runs.

Usage: python scripts/pictures.py demo [RUN_FOLDER]   docs/images/demo.jpg, from `make demo` or another run
       python scripts/pictures.py initialization      docs/images/initialization.jpg, in about a minute

The second one shows the points of the five initializations on four objects. It takes recordings and estimated
poses from `digs-warp study run initialization`, in out/study/initialization, and makes what is missing there,
which takes a minute or two per object. The simulator draws the truth.
"""

import sys
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.capture_writer import FrameImages
from digs_warp.data.frame import Frame
from digs_warp.data.images import read_image
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera
from digs_warp.measure.surface_metrics import surface_score
from digs_warp.record.files import write_atomically
from digs_warp.record.layout import INITIAL_POINTS
from digs_warp.record.progress import show_progress
from digs_warp.show.report.pictures import over_white
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.sensor_plan import make_plan
from digs_warp.sim.record.session import prepare_session
from digs_warp.study.catalogue import find_study
from digs_warp.study.engine.case import Case, with_settings
from digs_warp.study.engine.chain import SURFACE_THRESHOLD, start_of_case
from digs_warp.surface.true_surface import read_true_surface

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"

DEMO_FRAME, DEMO_ROWS, DEMO_COLUMNS = 32, slice(20, 350), slice(120, 520)

OBJECTS = ("ycb_mustard_bottle", "avocado", "spot", "armchair")
STRATEGIES = ("default", "random", "depth", "highdepth", "fusion")
FRAME = 5  # all panels are seen from the camera of this frame
SIZE = (1440, 810)  # of the drawing before it is cropped to the object [px]
MARGIN = 0.12  # of the object's size, around it
DOT_PX = 2  # a point covers this many pixels to either side
HIDDEN = 0.03  # a point this far [m] behind what the camera truly sees is hidden
PANEL = 2.35  # [inch]


def main(picture: str, *arguments: str) -> None:
    """Draw one of the pictures."""
    show_progress()
    if picture == "demo":
        draw_demo(*map(Path, arguments))
    else:
        draw_initialization()


def draw_demo(run: Path = Path("out/demo")) -> None:
    """Put four stages of one held-out view side by side."""
    capture = read_capture(run / "capture")
    frame = capture.frames[DEMO_FRAME]
    points = PointCloud.load(run / "reconstruction" / INITIAL_POINTS)
    panels = {
        "what the camera sees": frame.load_image(),
        "what its depth sensor reports": depth_picture(capture, frame),
        "points from the depth": points_picture(points, frame.camera, dot=0),
        "Gaussians, a view held out": read_image(run / f"reconstruction/renders/{frame.name}.png"),
    }
    figure, axes = plt.subplots(1, 4, figsize=(16, 3.75), dpi=110)
    for axis, (title, picture) in zip(axes, panels.items(), strict=True):
        axis.imshow(picture[DEMO_ROWS, DEMO_COLUMNS])
        axis.set_title(title, fontsize=14)
        axis.axis("off")
    figure.subplots_adjust(0.004, 0.004, 0.996, 0.9, wspace=0.02)
    save_jpeg(figure, IMAGES / "demo.jpg", 88)


def save_jpeg(figure: Figure, path: Path, quality: int) -> None:
    """Write a figure; the same pixels give the same bytes."""
    data = BytesIO()
    figure.savefig(data, format="jpeg", pil_kwargs={"quality": quality, "optimize": True})
    write_atomically(path, data.getvalue())


def depth_picture(capture: Capture, frame: Frame) -> np.ndarray:
    """Color the depth of the object's surroundings; near is bright."""
    distance = np.linalg.norm(frame.camera.center_world)
    reach = capture.about.object_radius or 0.0
    shade = (distance + reach - frame.load_depth()) / (2 * reach)
    return plt.get_cmap("viridis")(np.clip(np.nan_to_num(shade), 0, 1))[..., :3]


def draw_initialization() -> None:
    """Record, estimate the poses and initialize, unless the study has done so; draw."""
    study = find_study("initialization")
    cases = {
        (case.labels["object"], case.labels["strategy"]): case
        for case in reversed(study.cases(study.objects, 1, study.iterations))
    }
    columns = len(STRATEGIES) + 1
    figure, axes = plt.subplots(
        len(OBJECTS), columns, figsize=(columns * PANEL, len(OBJECTS) * (PANEL + 0.5)), dpi=110
    )
    for row, name in zip(axes, OBJECTS, strict=True):
        truth = true_view(cases[name, STRATEGIES[0]])
        assert truth.mask is not None and truth.depth_true is not None  # the simulator knows both
        window = window_around(truth.mask)
        for axis, strategy in zip(row, STRATEGIES, strict=False):
            capture, frames, points = start_of_case(cases[name, strategy], study.folder)
            cameras = {frame.name: frame.camera for frame in (*frames.training, *frames.held_out)}
            camera = cameras[capture.frames[FRAME].name].resized(*SIZE)
            picture = points_picture(points, camera, DOT_PX, truth.depth_true)
            show(axis, picture[window], strategy, caption(points, capture))
        object_name = name.removeprefix("ycb_").replace("_", " ")
        show(row[-1], over_white(truth.image, truth.mask)[window], "truth", object_name)
    figure.subplots_adjust(0.004, 0.045, 0.996, 0.965, wspace=0.03, hspace=0.28)
    save_jpeg(figure, IMAGES / "initialization.jpg", 78)


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


if __name__ == "__main__":
    main(*sys.argv[1:])
