"""Settings of depth by a network, apart from its code: the command line loads only these."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from digs_warp.checks import DigsError

DepthKind = Literal["inverse", "metric"]


@dataclass(frozen=True, kw_only=True)
class MonoDepthConfig:
    """Depth from a network, for photographs that came without."""

    mono_depth: Path | None = None
    """For recordings without depth: an ONNX file of a network that guesses depth from one image (MiDaS, Depth
    Anything, ...). Its depth is scaled to the sparse points of each view, and gives the points to start
    from."""

    mono_depth_kind: DepthKind | None = None
    """What that network gives. inverse: 1 / depth, up to a factor and an offset; metric: depth, up to a
    factor. Default: what the file's metadata say under 'depth'."""

    def __post_init__(self) -> None:
        if self.mono_depth_kind is not None and self.mono_depth is None:
            raise DigsError("--mono-depth-kind needs --mono-depth")
