"""Draw docs/images/initialization.jpg: the five initializations of one recording, side by side.

Usage: python scripts/initialization_picture.py   (about a minute)

The recording is simulated; sparse points are made from its truth, as in `digs-warp bench init-noise`.
"""

import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from digs_warp.camera import Camera
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initialize
from digs_warp.point_cloud import PointCloud
from digs_warp.study.init_cases import render_case
from digs_warp.study.init_strategies import SFM_PER_METRE, STRATEGIES, scaled
from digs_warp.study.synthetic_sfm import sfm_from_truth
from sim.config import SimulateConfig

TARGET = Path(__file__).resolve().parent.parent / "docs" / "images" / "initialization.jpg"
FRAMES, VIEW = 24, 5
SPARSE_POINTS = 12_000  # about as many as 60 images of 960x540 give
DOT_PX = 1  # a point covers this many pixels to either side


def main() -> None:
    """Simulate, initialize, draw."""
    with tempfile.TemporaryDirectory() as folder:
        case = render_case(SimulateConfig(frames=FRAMES, samples_per_pixel=2), Path(folder))
        capture = case.capture()
        sfm = sfm_from_truth(capture.frames, SFM_PER_METRE, points=SPARSE_POINTS)
        seen = scaled(capture, sfm, SFM_PER_METRE)
        frame = seen.frames[VIEW]
        panels = {"the photograph": frame.load_image() / 255.0}
        for strategy in STRATEGIES:
            points = initialize(seen.frames, InitConfig(strategy=strategy), seen.sfm).points
            title = f"{strategy}: {len(points):,} points"
            panels[title] = points_picture(points, frame.camera)
    figure, axes = plt.subplots(2, 3, figsize=(14, 5.9), dpi=100)
    for axis, (title, picture) in zip(axes.flat, panels.items(), strict=True):
        axis.imshow(picture)
        axis.set_title(title, fontsize=13)
        axis.axis("off")
    figure.subplots_adjust(0.004, 0.004, 0.996, 0.95, wspace=0.02, hspace=0.1)
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(TARGET, pil_kwargs={"quality": 88, "optimize": True})
    print(TARGET)  # noqa: T201 (a script)


def points_picture(points: PointCloud, camera: Camera) -> np.ndarray:
    """Draw the points as the camera sees them, near ones over far ones, on white."""
    k = camera.intrinsics
    picture = np.ones((k.height, k.width, 3))
    px, depth = camera.project(points.points_world)
    order = np.argsort(-depth)
    order = order[depth[order] > 0]
    columns, rows = np.floor(px[order]).astype(np.int64).T
    for down in range(-DOT_PX, DOT_PX + 1):
        for right in range(-DOT_PX, DOT_PX + 1):
            u, v = columns + right, rows + down
            inside = (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height)
            picture[v[inside], u[inside]] = points.colors[order][inside]
    return picture


if __name__ == "__main__":
    main()
