"""Flags of `digs-warp convert --from`."""

from dataclasses import dataclass

from digs_warp.bounds import check_flag


@dataclass(frozen=True, kw_only=True)
class RecordingOptions:
    """How a recording becomes a capture."""

    fov_deg: float | None = None
    """For recordings with lens distortion, such as fisheye: horizontal field of view of the undistorted
    images [degrees]. Default: the same focal length, so that the center stays as sharp as it is."""

    def __post_init__(self) -> None:
        if self.fov_deg is not None:
            check_flag("--fov-deg", self.fov_deg)
