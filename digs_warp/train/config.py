"""Settings of the training. Imports nothing heavy: the command line reads its help from here."""

import math
from dataclasses import dataclass, fields, replace
from typing import Literal

from digs_warp.checks import DigsError, check_positive
from digs_warp.record.durations import seconds_of
from digs_warp.sh import MAX_DEGREE


@dataclass(frozen=True)
class Rates:
    """Learning rates at the start: centres in units of the scene's extent, the rest as their parameters."""

    means: float
    scales: float
    quats: float
    opacities: float
    colors: float


REFERENCE_RATES = Rates(1.6e-4, 5e-3, 1e-3, 5e-2, 2.5e-3)

# Fitted to starts from dense depth: the splats are where they belong, what is left is to find their shapes
# and colours quickly. YCB mustard bottle at 800x450, 38,000 points, opaque start, held-out PSNR after 100 and
# 300 steps: 36.5 and 39.7 dB, with the reference's rates 34.2 and 36.5 dB. 1.5 to 2 times these rates of
# scales and colours change nothing; a fall of the rates of shape and colour to a tenth loses 1.5 dB.
DENSE_RATES = Rates(5e-4, 2e-2, 1e-2, 5e-2, 2e-2)

_RATE_OPTIONS = {field.name: f"{field.name}_rate" for field in fields(Rates)}


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """How the Gaussians are optimized."""

    iterations: int = 1000
    """Training steps; each looks at one view. Rates and schedules are laid out over all of them."""

    time_budget: str = ""
    """Stop after this much training time, for example 60s, 20min or 2h; empty: no limit."""

    target_psnr: float = 0.0
    """Stop as soon as the held-out views reach this PSNR [dB]; 0: never. They are then measured every 100
    iterations."""

    sh_degree: int = 1
    """View-dependent colour: spherical-harmonics degree, 0 (none) to 3."""

    background: Literal["random", "white", "black"] = "random"
    """Colour behind the object while training; random also punishes stray Gaussians of any colour."""

    mask_role: Literal["object", "ignore"] = "object"
    """What masks mean. object: outside is nothing, and Gaussians there are wrong; ignore: outside is unknown
    and not compared."""

    dssim_weight: float = 0.2
    """Share lambda of D-SSIM in the loss; the rest is L1."""

    coverage_weight: float = 0.0
    """Weight of the difference between coverage and mask: keeps the outside of the object empty with a fixed
    background, too."""

    depth_weight: float = 0.0
    """Weight of the difference between rendered and measured depth: untextured surfaces stay in place."""

    opacity_weight: float = -1.0
    """Weight of the mean opacity: fades what no view needs. -1: 0.01 with --density mcmc, else 0."""

    scale_weight: float = -1.0
    """Weight of the mean scale, in units of the scene's extent. -1: 0.01 with --density mcmc, else 0."""

    means_rate: float | None = None
    """Learning rate of the centres, in units of the scene's extent; falls to 1 % along the run. Default:
    5e-4 with --density fixed, else 1.6e-4 (3DGS)."""

    scales_rate: float | None = None
    """Learning rate of the logarithmic scales. Default: 0.02 with --density fixed, else 0.005 (3DGS)."""

    quats_rate: float | None = None
    """Learning rate of the rotations. Default: 0.01 with --density fixed, else 0.001 (3DGS)."""

    opacities_rate: float | None = None
    """Learning rate of the opacity logits. Default: 0.05 (3DGS)."""

    colors_rate: float | None = None
    """Learning rate of the base colour; higher bands learn at a twentieth of it. Default: 0.02 with --density
    fixed, else 0.0025 (3DGS)."""

    rates_end: float = 1.0
    """Share of their start that the rates of scales, rotations and colours fall to along the run. 1, as in
    3DGS, is best up to 1000 iterations from a dense start; less calms the end of long runs."""

    half_size_until: float | None = None
    """Share of the run that trains on images of half the size: these steps cost less. Default: 0.5,
    but 100 steps at most, with --density fixed and Gaussians that are wide enough for such images; else 0."""

    density: Literal["fixed", "default", "absgrad", "mcmc"] = "fixed"
    """How the number of Gaussians changes. fixed: not at all, best for a dense start from depth; default:
    clone, split, prune and reset of 3DGS; absgrad: the same with absolute gradients, fewer Gaussians for the
    same quality; mcmc: noise and relocation up to --max-splats, best from a poor start."""

    max_splats: int = 1_000_000
    """The strategies never grow beyond this many Gaussians."""

    splat_memory: float = 0.0
    """The strategies never grow beyond this much memory [MiB] for Gaussians and optimizer; 0: no limit."""

    image_memory: float = 2048.0
    """Photographs held in memory [MiB]; those of a longer recording are read again in the background."""

    evaluate_at: tuple[int, ...] = (100, 300, 500, 1000, 3000, 7000, 12000)
    """Iterations at which held-out views are measured, besides the first and the last."""

    keep_course: bool = False
    """Keep the Gaussians whenever held-out views are measured: the scene then shows the course of the
    training as time samples, without view dependence. 56 bytes a Gaussian and time on disk, 34 in the
    scene."""

    seed: int = 0
    """Decides the order of the views, the random backgrounds, and every draw of a strategy."""

    device: str = "cpu"
    """Warp device: cpu or cuda."""

    def __post_init__(self) -> None:
        if self.iterations < 0:
            raise DigsError(f"iterations: {self.iterations}, expected 0 or more")
        if self.sh_degree not in range(MAX_DEGREE + 1):
            raise DigsError(f"sh-degree: {self.sh_degree}, expected 0 to {MAX_DEGREE}")
        for name in ("dssim_weight", "half_size_until"):
            value = getattr(self, name)
            if value is not None and not 0.0 <= value <= 1.0:
                raise DigsError(f"{_flag(name)}: {value}, expected 0 to 1")
        for name in ("coverage_weight", "depth_weight", "splat_memory", "target_psnr"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise DigsError(f"{_flag(name)}: {getattr(self, name)}, expected 0 or more")
        for name in ("opacity_weight", "scale_weight"):
            value = getattr(self, name)
            if not (math.isfinite(value) and (value >= 0 or value == -1)):
                raise DigsError(f"{_flag(name)}: {value}, expected 0 or more, or -1")
        for name in (*_RATE_OPTIONS.values(), "rates_end"):
            if getattr(self, name) is not None:
                check_positive(_flag(name), getattr(self, name))
        if self.max_splats < 1:
            raise DigsError(f"max-splats: {self.max_splats}, expected 1 or more")
        check_positive("image-memory", self.image_memory)
        if self.mask_role == "ignore" and self.coverage_weight > 0:
            raise DigsError(
                "coverage-weight: pulls the outside of the masks to empty, but --mask-role ignore says that "
                "nothing is known there; leave one of the two out"
            )
        seconds_of(self.time_budget, "time-budget")

    @property
    def rates(self) -> "Rates":
        """The rates, defaults resolved."""
        usual = DENSE_RATES if self.density == "fixed" else REFERENCE_RATES
        given = {field.name: getattr(self, _RATE_OPTIONS[field.name]) for field in fields(Rates)}
        return replace(usual, **{name: value for name, value in given.items() if value is not None})

    @property
    def time_budget_seconds(self) -> float:
        """The time budget [s]; infinite without one."""
        return seconds_of(self.time_budget, "time-budget")

    def regularizer_weights(self) -> tuple[float, float]:
        """Return the weights of mean opacity and mean scale, -1 resolved."""
        # 0.01 each: the values of 3dgs-mcmc and gsplat.
        usual = 0.01 if self.density == "mcmc" else 0.0
        opacity, scale = self.opacity_weight, self.scale_weight
        return (usual if opacity < 0 else opacity), (usual if scale < 0 else scale)


def _flag(name: str) -> str:
    return name.replace("_", "-")
