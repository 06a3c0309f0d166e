"""Settings of structure from motion, apart from their code: the command line loads only these."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from digs_warp.checks import DigsError
from digs_warp.settings import NO_FLAG, SEED, Range, Settings
from digs_warp.words import did_you_mean

if TYPE_CHECKING:
    from digs_warp.data.capture import Capture


# Where poses come from, beside a printed board.
WAYS = ("sfm", "rgbd", "auto", "capture")


@dataclass(frozen=True, kw_only=True)
class SfmConfig(Settings):
    """Where camera poses and sparse points come from."""

    poses: str = "sfm"
    """Camera poses. capture: those of the recording; sfm: from the images, the scale from the depth maps;
    rgbd: from color and depth of a film, where there is too little texture for sfm; auto: sfm, but rgbd where
    that fails or depth contradicts it; board:FILE: from a printed board (docs/poses.md), in metres."""

    feature_size: Annotated[int, Range(32, 16_384)] = 1200
    """Longest side [px] of the images used for feature detection; larger images are reduced to it. Smaller
    is faster but gives less accurate poses."""

    features: Annotated[int, Range(50, 100_000)] = 2000
    """Keep at most this many features per image, the largest ones first; more take longer to match."""

    double_size: Annotated[bool | None, NO_FLAG] = None
    """Also detect features in the image enlarged twice: more and smaller ones, in four times the time.
    Default: only if its longest side is at most 1000 px."""

    pairing: Literal["auto", "sequential", "exhaustive"] = "auto"
    """Which images are matched. sequential: each with its neighbors in time and with those that look most
    similar (loops), for a video; exhaustive: each with all others, for unordered images; auto: exhaustive
    up to 40 images."""

    overlap: Annotated[int, Range(1, 1000), NO_FLAG] = 6
    """For sequential pairing: how many images before and after each one are matched with it."""

    loop_images: Annotated[int, Range(0, 1000), NO_FLAG] = 3
    """For sequential pairing: how many of the most similar images are matched as well; closes loops. 0:
    none."""

    refine_focal: bool = False
    """Also estimate the focal lengths, with those of the recording as initial values."""

    # No video camera takes longer for an image; a larger number was meant in milliseconds.
    readout_time: Annotated[float | None, Range(0, 0.5, "seconds")] = None
    """Rolling shutter: time from the first row to the last [s], which pose estimation and training correct
    for. 0: all rows at once. Default: the value in the recording."""

    min_registered: Annotated[float, Range(1e-6, 1)] = 0.9
    """Fraction of the images that must be placed in one model; with fewer the run stops and says why. Lower
    it to continue with the largest model and a warning."""

    refine_poses: Literal["off", "auto", "on"] = "auto"
    """Whether the poses are refined: before anything is made from them, by aligning color and depth of
    overlapping frames, and in the training, where cameras move until their photographs fit; held-out ones
    included. off: never; auto: if the frames agree much better aligned, in the training also estimated poses,
    and without depth those that matched features miss, but not the exact ones of a simulation; on: always."""

    sfm_seed: Annotated[int, SEED, NO_FLAG] = 0
    """Seed of everything random: matching and mapping."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.poses not in WAYS and self.board is None:
            raise DigsError(
                f"--poses {self.poses}{did_you_mean(self.poses, (*WAYS, 'board:FILE'))}"
            )

    @property
    def board(self) -> Path | None:
        """The file of a printed board that gives the poses; None: something else does."""
        name = self.poses.removeprefix("board:")
        return Path(name) if name not in ("", self.poses) else None

    def for_capture(self, capture: "Capture") -> "SfmConfig":
        """Return the settings with the recording's value where they leave the read-out time open.

        A stage that takes a recording begins with this; after it, `readout` is known.
        """
        if self.readout_time is not None:
            return self
        return replace(self, readout_time=capture.readout_time)

    @property
    def readout(self) -> float:
        """The time from the first row to the last [s], of settings that are `for_capture`."""
        assert self.readout_time is not None
        return self.readout_time
