"""`digs-warp render`: a film of Gaussians."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command, SplatOptions
from digs_warp.commands.output import check_output_file
from digs_warp.record.progress import progress
from digs_warp.settings import FIELD_OF_VIEW, FRAME_RATE, SIDE, Range
from digs_warp.words import counted

if TYPE_CHECKING:
    import numpy as np

    from digs_warp.geometry.camera import Camera
    from digs_warp.show.film.camera_path import Subject

ORBIT_FOV_DEG = 45.0


@dataclass(frozen=True, kw_only=True)
class Render(Command):
    """Film a scene: an orbit around the object, or along the path of a capture.

    Prints how many frames per second were rendered, without the time to write the video.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """A folder of 'digs-warp reconstruct' or 'run', or Gaussians as .npz, .ply, .spz, .splat or USD."""

    out: Path
    """What to write: a video (.mp4, H.264) or an animated .gif."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the file if it exists."""

    follow: Path | None = None
    """Move along the camera path of this capture folder instead of around the object."""

    elevation_deg: Annotated[float, Range(-89.9, 89.9)] = 20.0
    """Elevation of the orbit above the horizon [degrees]."""

    seconds: Annotated[float, Range(0.01, 3600)] = 4.0
    """Length of the film; an orbit is one turn."""

    fps: Annotated[float, FRAME_RATE] = 30.0
    """Frames per second of the film."""

    width: Annotated[int, SIDE] = 1280
    """Width of a frame [px]."""

    height: Annotated[int, SIDE] = 720
    """Height of a frame [px]."""

    fov_deg: Annotated[float | None, FIELD_OF_VIEW] = None
    """Horizontal field of view [degrees]. Default: 45 for an orbit, the capture's for its path."""

    background: Annotated[tuple[float, float, float], Range(0, 1)] = (1.0, 1.0, 1.0)
    """Red, green and blue of the background, 0 to 1."""

    scene: Annotated[SplatOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SplatOptions)

    def execute(self) -> str:
        """Render, write, and say how fast it went."""
        from digs_warp.show.film.camera_path import find_framed_subject
        from digs_warp.show.film.video import SUFFIXES, Clock, shoot, write_video

        if self.out.suffix.lower() not in SUFFIXES:
            raise DigsError(
                f"--out '{self.out}': suffix '{self.out.suffix}', expected {' or '.join(SUFFIXES)}"
            )
        check_output_file(self.out, self.overwrite, [self.source, self.follow])
        gaussians = self.scene.read(self.source).gaussians
        subject = find_framed_subject(gaussians)
        cameras = self._cameras(subject)
        clock = Clock()
        frames = _with_progress(
            shoot(
                gaussians,
                cameras,
                background=self.background,
                center_world=subject.center_world,
                clock=clock,
            ),
            len(cameras),
        )
        count = write_video(self.out, frames, self.fps)
        return (
            f"{self.out}: {counted(count, 'frame')} of {self.width}x{self.height} px, "
            f"{counted(len(gaussians), 'Gaussian')}; "
            f"rendered {clock.frame_rate:.1f} frames/s ({clock.milliseconds:.0f} ms each)"
        )

    def _cameras(self, subject: "Subject") -> "list[Camera]":
        from digs_warp.data.capture import read_capture
        from digs_warp.geometry.camera import Intrinsics
        from digs_warp.show.film.camera_path import along, orbit, same_width_of_view

        count = max(1, round(self.seconds * self.fps))
        size = self.width, self.height
        if self.follow is None:
            k = Intrinsics.from_fov(*size, self.fov_deg or ORBIT_FOV_DEG)
            return orbit(subject, k, count, self.elevation_deg)
        frames = read_capture(self.follow).frames
        k = (
            Intrinsics.from_fov(*size, self.fov_deg)
            if self.fov_deg
            else same_width_of_view(frames[0].camera.intrinsics, *size)
        )
        poses = [frame.camera.world_from_cam for frame in frames]
        return along(poses, [frame.time for frame in frames], k, count)


def _with_progress(frames: "Iterator[np.ndarray]", count: int) -> "Iterator[np.ndarray]":
    with progress(count, "Rendering", "frame") as bar:
        for frame in frames:
            yield frame
            bar.update()
