"""Settings of the object masks, apart from their code: the command line loads only these."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from digs_warp.checks import DigsError
from digs_warp.settings import Range, Settings


@dataclass(frozen=True, kw_only=True)
class SegmentConfig(Settings):
    """Where object masks come from."""

    masks: Literal["capture", "folder", "depth"] = "capture"
    """Object masks. capture: those of the recording; folder: those in --mask-folder, of
    any network; depth: the foreground of the depth maps."""

    instance: Annotated[int | None, Range(1, 65_535)] = None
    """For capture: the number of one object of a recording of several ('digs-warp info' lists them). Default:
    all of them."""

    mask_folder: Path | None = None
    """For folder: PNG files named like the frames (0000.png); 255 on the object, or cut-outs with alpha."""

    ignore_mask: Path | None = None
    """What is no scene in any image, such as a gripper that moves with the camera: an image of their size,
    255 there. It is neither trained nor scored. Black borders of undistorted photographs are found by
    themselves."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.masks == "folder") != (self.mask_folder is not None):
            raise DigsError(
                "--masks folder and --mask-folder PATH belong together; give both or none"
            )
        if self.instance is not None and self.masks != "capture":
            raise DigsError(f"--instance {self.instance}: needs --masks capture")

    @property
    def source(self) -> str:
        """What masks are made of: ``masks``, or "instance" for one of several objects."""
        return self.masks if self.instance is None else "instance"
