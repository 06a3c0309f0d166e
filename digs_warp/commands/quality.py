"""How well a reconstruction matches the views that it has not seen."""

from dataclasses import dataclass
from pathlib import Path

from digs_warp.record.files import read_json
from digs_warp.record.layout import EVALUATION


@dataclass(frozen=True)
class Quality:
    """Means over the held-out views: "psnr" [dB], "ssim", and both inside the mask.

    A mean is None where it is defined in no view (no object in sight, or not one wrong pixel).
    """

    views: int
    mean: dict[str, float | None]

    def __str__(self) -> str:
        """One phrase for summaries."""
        psnr, ssim = self.mean.get("psnr"), self.mean.get("ssim")
        words = [] if psnr is None else [f"PSNR {psnr:.2f} dB"]
        words += [] if ssim is None else [f"SSIM {ssim:.4f}"]
        return f"{' and '.join(words) or 'no measure'} on {self.views} held-out views"


def read_quality(reconstruction: Path) -> Quality:
    """Return what the evaluation of a reconstruction folder says."""
    evaluation = read_json(reconstruction / EVALUATION, "evaluation")
    return Quality(len(evaluation.get("views", [])), evaluation.get("mean", {}))
