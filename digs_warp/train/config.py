"""Settings of the training. Imports nothing heavy: the command line reads its help from here."""

from dataclasses import dataclass
from typing import Literal

from digs_warp.checks import DigsError, check_positive
from digs_warp.sh import MAX_DEGREE


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """How the Gaussians are optimized; rates are those of the 3DGS reference."""

    iterations: int = 1000
    """Training steps; each looks at one view."""

    sh_degree: int = 1
    """View-dependent colour: spherical-harmonics degree, 0 (none) to 3."""

    background: Literal["random", "white", "black"] = "random"
    """Colour behind the object while training; random also punishes stray Gaussians of any colour."""

    dssim_weight: float = 0.2
    """Share lambda of D-SSIM in the loss; the rest is L1."""

    means_rate: float = 1.6e-4
    """Learning rate of the centres, in units of the scene's extent; falls to 1 % along the run."""

    scales_rate: float = 5e-3
    """Learning rate of the logarithmic scales."""

    quats_rate: float = 1e-3
    """Learning rate of the rotations."""

    opacities_rate: float = 5e-2
    """Learning rate of the opacity logits."""

    colors_rate: float = 2.5e-3
    """Learning rate of the base colour; higher bands learn at a twentieth of it."""

    evaluate_at: tuple[int, ...] = (100, 300, 500, 1000, 3000, 7000, 12000)
    """Iterations at which held-out views are measured, besides the first and the last."""

    seed: int = 0
    """Decides the order of the views and the random backgrounds."""

    device: str = "cpu"
    """Warp device: cpu or cuda."""

    def __post_init__(self) -> None:
        if self.iterations < 0:
            raise DigsError(f"iterations: {self.iterations}, expected 0 or more")
        if self.sh_degree not in range(MAX_DEGREE + 1):
            raise DigsError(f"sh-degree: {self.sh_degree}, expected 0 to {MAX_DEGREE}")
        if not 0.0 <= self.dssim_weight <= 1.0:
            raise DigsError(f"dssim-weight: {self.dssim_weight}, expected 0 to 1")
        for name in ("means", "scales", "quats", "opacities", "colors"):
            check_positive(f"{name}-rate", getattr(self, f"{name}_rate"))
