"""Settings of the object masks, apart from their code: the command line loads only these."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from digs_warp.checks import DigsError


@dataclass(frozen=True, kw_only=True)
class SegmentConfig:
    """Where object masks come from."""

    masks: Literal["capture", "folder", "isnet", "depth", "degraded"] = "capture"
    """Masks: 'capture' takes those of the recording; 'folder' those of --mask-folder; 'isnet' asks the
    network isnet-general-use; 'depth' needs no network and takes what stands in front; 'degraded' spoils the
    recording's own, to see how much that costs."""

    mask_folder: Path | None = None
    """For 'folder': PNG files named like the frames (0000.png); 255 on the object, or cut-outs with alpha."""

    mask_model: Path | None = None
    """For 'isnet': the network as an ONNX file. Default: isnet-general-use.onnx where rembg keeps
    it, ~/.u2net."""

    mask_error: float = 1.0
    """For 'degraded': how bad; 0 changes nothing, 1 is a usual failure, 2 twice as large."""

    mask_seed: int = 0
    """Seed of 'degraded'."""

    def __post_init__(self) -> None:
        if (self.masks == "folder") != (self.mask_folder is not None):
            raise DigsError(
                "--masks folder and --mask-folder PATH belong together; give both or none"
            )
        if self.mask_model is not None and self.masks != "isnet":
            raise DigsError("--mask-model needs --masks isnet")
        if not 0 <= self.mask_error <= 10:
            raise DigsError(f"mask_error: {self.mask_error}, expected 0 to 10")
        if self.mask_seed < 0:
            raise DigsError(f"mask_seed: {self.mask_seed}, expected 0 or above")
