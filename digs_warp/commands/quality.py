"""How well a reconstruction matches the views that it has not seen."""

from dataclasses import dataclass
from pathlib import Path

from digs_warp.commands.layout import EVALUATION
from digs_warp.log import read_json


@dataclass(frozen=True)
class Quality:
    """Means over the held-out views: "psnr" [dB], "ssim", and both inside the mask."""

    views: int
    mean: dict[str, float]

    def __str__(self) -> str:
        """One phrase for summaries."""
        return (
            f"PSNR {self.mean['psnr']:.2f} dB and SSIM {self.mean['ssim']:.4f} "
            f"on {self.views} held-out views"
        )


def read_quality(reconstruction: Path) -> Quality:
    """Return what the evaluation of a reconstruction folder says."""
    evaluation = read_json(reconstruction / EVALUATION, "evaluation")
    return Quality(len(evaluation["views"]), evaluation["mean"])
