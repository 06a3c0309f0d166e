"""The pictures of README and docs that show the run of `make demo`: its stages, its report, its view.

Needs Chromium: apt-get install chromium.
"""

import tempfile
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import encode_jpeg, read_image
from digs_warp.data.point_cloud import PointCloud
from digs_warp.geometry.camera import Camera
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.files import write_atomically
from digs_warp.record.layout import INITIAL_POINTS
from digs_warp.show.view.contents import read_contents
from digs_warp.show.view.server import started
from scripts.headless_browser import Browser, browser
from scripts.page_marks import DOCS
from studies.pages import save_figure

IMAGES = DOCS / "images"

FRAME, ROWS, COLUMNS = 3, slice(10, 345), slice(110, 520)
NECK = NECK_ROWS, NECK_COLUMNS = slice(20, 170), slice(225, 385)
SIZES = {"half the size": 0.5, "as trained": 1.0, "twice the size": 2.0}

# A point this far [m] behind what the camera truly sees is hidden, and one covers so many pixels around.
HIDDEN, DOT = 0.03, 1

# A browser without a graphics card takes this long at most for the first picture [s].
LONGEST = 120

DESK, VIEW = (1280, 800), (1280, 720)
CANVAS = "document.querySelector('#view3d canvas')"


def main(run: Path = Path("out/demo")) -> None:
    """Draw demo.jpg, sizes.jpg, report.jpg and view.jpg."""
    draw_stages(run)
    draw_sizes(run)
    photograph_report(run)
    photograph_view(run)


def draw_stages(run: Path) -> None:
    """Put four stages of one held-out view side by side."""
    capture = read_capture(run / "capture")
    frame = capture.frames[FRAME]
    points = PointCloud.load(run / "reconstruction" / INITIAL_POINTS)
    panels = {
        "what the camera sees": frame.load_image(),
        "what its depth sensor reports": depth_picture(capture, frame),
        "points from the depth": points_picture(points, frame.camera, frame.load_depth_true()),
        "Gaussians, a view held out": read_image(run / f"reconstruction/renders/{frame.name}.png"),
    }
    figure = Figure(figsize=(16, 3.75), dpi=110)
    axes = figure.subplots(1, 4)
    for axis, (title, picture) in zip(axes, panels.items(), strict=True):
        axis.imshow(picture[ROWS, COLUMNS])
        axis.set_title(title, fontsize=14)
        axis.axis("off")
    figure.subplots_adjust(0.004, 0.004, 0.996, 0.9, wspace=0.02)
    save_figure(figure, IMAGES / "demo.jpg", 88)


def draw_sizes(run: Path) -> None:
    """Put the neck of the vase, whose handle is thin, side by side at several sizes, without dilation."""
    result = Reconstruction.load(run / "reconstruction")
    frame = read_capture(run / "capture").frames[FRAME]
    k = frame.camera.intrinsics
    figure = Figure(figsize=(16, 4.6), dpi=110)
    axes = figure.subplots(1, 1 + len(SIZES))
    axes[0].imshow(frame.load_image()[NECK_ROWS, NECK_COLUMNS])
    axes[0].set_title("photograph, held out", fontsize=14)
    for axis, (title, factor) in zip(axes[1:], SIZES.items(), strict=True):
        camera = frame.camera.resized(int(factor * k.width), int(factor * k.height))
        part = [slice(int(factor * s.start), int(factor * s.stop)) for s in NECK]
        axis.imshow(np.clip(result.render(camera).image, 0.0, 1.0)[tuple(part)])
        axis.set_title(title, fontsize=14)
    for axis in axes:
        axis.axis("off")
    figure.subplots_adjust(0.004, 0.004, 0.996, 0.92, wspace=0.02)
    save_figure(figure, IMAGES / "sizes.jpg", 88)


def depth_picture(capture: Capture, frame: Frame) -> np.ndarray:
    """Color the depth of the object's surroundings; near is bright."""
    distance = np.linalg.norm(frame.camera.center_world)
    reach = capture.about.object_radius or 0.0
    shade = (distance + reach - frame.load_depth()) / (2 * reach)
    return colormaps["viridis"](np.clip(np.nan_to_num(shade), 0, 1))[..., :3]


def points_picture(points: PointCloud, camera: Camera, depth_true: np.ndarray) -> np.ndarray:
    """Draw the points that the camera truly sees, near ones over far ones, on white."""
    width, height = camera.intrinsics.width, camera.intrinsics.height
    picture = np.ones((height, width, 3))
    px, depth = camera.project(points.points_world)
    order = np.argsort(-depth)
    order = order[depth[order] > 0]
    columns, rows = np.floor(px[order]).astype(np.int64).T
    seen = depth_true[rows.clip(0, height - 1), columns.clip(0, width - 1)]
    visible = ~(depth[order] > seen + HIDDEN)  # where nothing is, nothing hides
    order, columns, rows = order[visible], columns[visible], rows[visible]
    for down, right in product(range(-DOT, DOT + 1), repeat=2):
        u, v = columns + right, rows + down
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        picture[v[inside], u[inside]] = points.colors[order][inside]
    return picture


def photograph_report(run: Path) -> None:
    """Open the report, and keep what the browser shows."""
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        browser(Path(folder), DESK) as tab,
    ):
        tab.resize(*DESK)
        tab.visit((run / "report.html").resolve().as_uri())
        save(shown(tab), "report.jpg")


def shown(tab: Browser) -> np.ndarray:
    """Return the window with the top of the page, once it is drawn in full detail."""
    tab.run("document.fonts.ready.then(() => true)")
    tab.run("new Promise((done) => setTimeout(done, 1000))")
    tab.wait_for(f"{CANVAS}.dataset.detail === '1'", LONGEST)
    return tab.screenshot()


def photograph_view(run: Path) -> None:
    """Open the page of `digs-warp view`, wait, and keep what the browser shows."""
    with (
        started([read_contents(run)], "127.0.0.1", 8080) as address,
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        browser(Path(folder), DESK) as tab,
    ):
        tab.resize(*VIEW)
        tab.visit(address)
        tab.run("new Promise((done) => setTimeout(done, 1000))")
        tab.wait_for(f"{CANVAS}.dataset.detail === '1'", LONGEST)
        tab.click("input[name=cameras]")
        save(shown(tab), "view.jpg")


def save(picture: np.ndarray, name: str) -> None:
    """Write a picture of the documentation."""
    write_atomically(IMAGES / name, encode_jpeg(np.ascontiguousarray(picture), 85))
