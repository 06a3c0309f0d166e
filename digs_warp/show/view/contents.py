"""What a file or folder holds to be looked at: Gaussians, views, points."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import read_capture
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.layers import Layer
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.viewpoints import evenly
from digs_warp.geometry.camera import pixel_centers
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.scene_files import read_scene
from digs_warp.record import layout
from digs_warp.show.film.camera_path import Subject, find_framed_points, find_framed_subject
from digs_warp.show.report.view3d.start import FirstView, around, as_recorded
from digs_warp.show.view.layers import points_as_splats
from digs_warp.words import counted

NAME, GAUSSIANS = "sensed depth", "gaussians"

# Frames and points of a cloud: a browser draws some hundred thousand points smoothly.
FRAMES, POINTS = 24, 200_000


def sensed_points(frames: Sequence[Frame]) -> dict[str, PointCloud]:
    """Return the cloud by its name; empty where no frame has depth.

    Depth is shown as it was measured, also around the object and where it is wrong.

    Raises:
        CaptureError: an image cannot be read, or is not of the camera's size.
    """
    with_depth = evenly([frame for frame in frames if frame.has(Layer.DEPTH)], FRAMES)
    clouds = list(_clouds(with_depth))
    return {NAME: PointCloud.joined(clouds)} if clouds else {}


def _clouds(frames: Sequence[Frame]) -> Iterator[PointCloud]:
    for frame in frames:
        depth = frame.load_depth()
        height, width = depth.shape
        step = max(1, round(np.sqrt(depth.size * len(frames) / POINTS)))
        chosen = np.zeros(depth.shape, dtype=bool)
        chosen[step // 2 :: step, step // 2 :: step] = True
        chosen &= np.isfinite(depth) & (depth > 0)
        camera = frame.camera.resized(width, height)
        pixels = pixel_centers(width, height)[chosen]
        points = camera.unproject(pixels, depth[chosen].astype(np.float64))
        yield PointCloud(points, _colors_at(frame.load_image(), pixels / [width, height]))


def _colors_at(photo: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the colors in 0..1 at places in 0..1 of the image, shape (n, 3)."""
    height, width = photo.shape[:2]
    columns, rows = (places * [width, height]).astype(np.int64).T
    return photo[rows, columns].astype(np.float32) / 255.0


# The stage of a finished training, and of Gaussians of which only this one is known.
RESULT = "result"


@dataclass(frozen=True, eq=False)
class Stage:
    """Gaussians at one moment of the training; ``label`` says which."""

    label: str
    gaussians: Gaussians


@dataclass(frozen=True, eq=False)
class Contents:
    """What one file or folder holds.

    Attributes:
        name: of the file or folder.
        facts: what the page says about it, a line each.
        stages: the Gaussians along the training, the result last; empty for captures.
        frames: the views, in the order of time; empty where they are not known.
        points: clouds by their names, such as "start".
        is_scene: everything in view is shown, not one object.
        held_out: names of the frames that trained nothing.
    """

    name: str
    facts: tuple[str, ...] = ()
    stages: tuple[Stage, ...] = ()
    frames: tuple[Frame, ...] = ()
    points: dict[str, PointCloud] = field(default_factory=dict)
    is_scene: bool = False
    held_out: frozenset[str] = frozenset()

    @property
    def subject(self) -> Subject:
        """The ball around it."""
        if self.stages:
            return find_framed_subject(self.stages[-1].gaussians)
        return find_framed_points(self._points())

    def first_view(self) -> FirstView:
        """Return from where it is looked at first."""
        cameras = [frame.camera for frame in self.frames]
        if self.is_scene and cameras:
            return as_recorded(self._points(), cameras)
        return around(self.subject, cameras)

    def layers(self) -> dict[str, list[Gaussians]]:
        """Return what can be shown and hidden, as Gaussians: one set each, or the stages of a training."""
        radius = self.subject.radius
        return {
            **({GAUSSIANS: [stage.gaussians for stage in self.stages]} if self.stages else {}),
            **{name: [points_as_splats(cloud, radius)] for name, cloud in self.points.items()},
        }

    def _points(self) -> np.ndarray:
        """Return points that say where it is and how large [m], shape (n, 3); never empty."""
        if self.stages:
            return self.stages[-1].gaussians.means
        surfaces = [cloud.points_world for cloud in self.points.values()]
        centers = np.array([frame.camera.center_world for frame in self.frames])
        return next(points for points in (*surfaces, centers) if len(points))


def read_contents(path: Path, read: Callable[[Path], Reconstruction] = read_scene) -> Contents:
    """Read what ``path`` holds.

    Args:
        path: a capture, the folder of 'digs-warp reconstruct' or 'run', or Gaussians of any supported file.
        read: reads Gaussians.

    Raises:
        DigsError: it is missing, broken, empty or none of these.
    """
    if not path.exists():
        raise DigsError(f"'{path}': no such file or folder. Check the path.")
    if (path / INDEX_NAME).is_file():
        return _of_capture(path)
    return _of_reconstruction(path, read(path))


def _of_capture(folder: Path) -> Contents:
    capture = read_capture(folder)
    frames = capture.frames
    if not capture.knows_poses:
        raise DigsError(
            f"capture '{folder}': it has no poses, so nothing can be placed; 'digs-warp reconstruct "
            "--poses sfm' finds them: look at its folder"
        )
    sparse = capture.load_points()
    points = {"points of the recording": sparse} if sparse is not None else {}
    facts = (f"{counted(len(frames), 'frame')} of {frames[0].camera.intrinsics.width} px",)
    return Contents(
        folder.name,
        facts,
        frames=tuple(frames),
        points=points | sensed_points(frames),
        is_scene=True,  # nothing says where its object is
    )


def _of_reconstruction(path: Path, result: Reconstruction) -> Contents:
    if not len(result.gaussians):
        raise DigsError(f"'{path}': it holds 0 Gaussians, nothing to show")
    frames = [frame for frame, _ in result.frames.by_time] if result.frames else []
    points = {"start": result.start.points} if result.start else {}
    return Contents(
        _name(path),
        _facts(result),
        tuple(_stages(result)),
        tuple(frames),
        points | sensed_points(frames),
        result.poses.subject == "scene",
        frozenset(frame.name for frame in result.frames.held_out) if result.frames else frozenset(),
    )


def _name(path: Path) -> str:
    """Return the name of a folder; that of 'digs-warp run' and not 'reconstruction' inside it."""
    path = path.resolve()
    return path.parent.name if path.name == layout.RECONSTRUCTION else path.name


def _stages(result: Reconstruction) -> Iterable[Stage]:
    for iteration, gaussians in result.load_snapshots():
        yield Stage(f"iteration {iteration}", gaussians)
    yield Stage(RESULT, result.gaussians)


def _facts(result: Reconstruction) -> tuple[str, ...]:
    facts = [f"{counted(len(result.gaussians), 'Gaussian')}, degree {result.gaussians.sh_degree}"]
    if result.scores.views:
        mean = result.scores.mean
        facts.append(f"held out: {mean.psnr_object:.2f} dB, SSIM {mean.ssim_object:.3f}")
    if result.scores.other_sizes is not None:
        facts.append(f"from other distances: {result.scores.other_sizes}")
    if result.scores.surface is not None:
        facts.append(f"accuracy {1e3 * result.scores.surface.accuracy:.2f} mm")
    if result.training.adherence is not None:
        facts.append(f"{1e3 * result.training.adherence:.2f} mm from the measured depth")
    return tuple(facts)
