"""Flags of `digs-warp convert --from`."""

from dataclasses import dataclass
from typing import Annotated

from digs_warp.settings import FIELD_OF_VIEW, FRAMES, Settings


@dataclass(frozen=True, kw_only=True)
class RecordingOptions(Settings):
    """How a recording becomes a capture."""

    frames: Annotated[int | None, FRAMES] = None
    """For recordings: take at most this number of frames, evenly spread; of a film, the sharpest near each of
    these moments. Default: all, of a film 120."""

    fov_deg: Annotated[float | None, FIELD_OF_VIEW] = None
    """For recordings with lens distortion, such as fisheye: horizontal field of view of the undistorted
    images [degrees]. Default: the same focal length, so that the center stays as sharp as it is. For a
    film: the field of view of its camera."""
