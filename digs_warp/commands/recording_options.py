"""Flags of `digs-warp convert --from`."""

from dataclasses import dataclass

from digs_warp.bounds import check_flag


@dataclass(frozen=True, kw_only=True)
class RecordingOptions:
    """How a recording becomes a capture."""

    frames: int | None = None
    """For recordings: take at most this number of frames, evenly spread; of a film, the sharpest near each of
    these moments. Default: all, of a film 120."""

    fov_deg: float | None = None
    """For recordings with lens distortion, such as fisheye: horizontal field of view of the undistorted
    images [degrees]. Default: the same focal length, so that the center stays as sharp as it is. For a
    film: the field of view of its camera."""

    def __post_init__(self) -> None:
        if self.frames is not None:
            check_flag("--frames", self.frames)
        if self.fov_deg is not None:
            check_flag("--fov-deg", self.fov_deg)
