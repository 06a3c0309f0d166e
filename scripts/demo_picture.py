"""Draw docs/images/demo.jpg, the picture of the README, from the results of `make demo`.

Usage: python scripts/demo_picture.py [RUN_FOLDER]   (default: out/demo)
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from digs_warp.data.capture import Capture, Frame, read_capture
from digs_warp.data.images import read_image

TARGET = Path(__file__).resolve().parent.parent / "docs" / "images" / "demo.jpg"


def main() -> None:
    """Put four stages of one held-out view side by side."""
    run = Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo")
    capture = read_capture(run / "capture")
    frame = capture.frames[32]
    reconstruction = run / "reconstruction"
    panels = {
        "what the camera sees": frame.load_image(),
        "what its depth sensor reports": depth_picture(capture, frame),
        "points from the depth": points_picture(frame, reconstruction / "initial_points.npz"),
        "Gaussians, a view held out": read_image(reconstruction / f"renders/{frame.name}.png"),
    }
    rows = slice(20, 350)
    columns = slice(120, 520)
    figure, axes = plt.subplots(1, 4, figsize=(16, 3.75), dpi=110)
    for axis, (title, picture) in zip(axes, panels.items(), strict=True):
        axis.imshow(picture[rows, columns])
        axis.set_title(title, fontsize=14)
        axis.axis("off")
    figure.subplots_adjust(0.004, 0.004, 0.996, 0.9, wspace=0.02)
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(TARGET, pil_kwargs={"quality": 88, "optimize": True})
    print(TARGET)  # noqa: T201 (a script)


def depth_picture(capture: Capture, frame: Frame) -> np.ndarray:
    """Colour the depth of the object's surroundings; near is bright."""
    depth = frame.load_depth()
    distance = np.linalg.norm(frame.camera.center_world)
    reach = capture.about.object_radius or 0.0
    shade = (distance + reach - depth) / (2 * reach)
    colors = plt.get_cmap("viridis")(np.clip(np.nan_to_num(shade), 0, 1))[..., :3]
    return colors


def points_picture(frame: Frame, path: Path) -> np.ndarray:
    """Draw the points as the frame's camera sees them, near ones over far ones."""
    k = frame.camera.intrinsics
    picture = np.ones((k.height, k.width, 3))
    with np.load(path) as points:
        px, depth = frame.camera.project(points["points_world"])
        order = np.argsort(-depth)
        columns, rows = np.floor(px[order]).astype(int).T
        inside = (columns >= 0) & (columns < k.width) & (rows >= 0) & (rows < k.height)
        picture[rows[inside], columns[inside]] = points["colors"][order][inside]
    return picture


if __name__ == "__main__":
    main()
