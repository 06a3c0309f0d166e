"""Depth-initialized Gaussian splatting on a CPU: from a stereo depth recording to a USD scene.

    import digs_warp as dw

    capture = dw.simulate("mug.glb", frames=20)        # a recording, in memory or in a folder
    result = dw.reconstruct(capture, iterations=300)
    result.save_usd("mug.usdz")
    view = result.render(capture.frames[0].camera)
    gradients = view.backward(adj_image=...)           # NumPy in, NumPy out

The names in ``__all__`` are public: they keep their meaning, and a change is announced in CHANGELOG.md, as
for the command line and the file formats. Everything else may change with any version. The functions take
what the command line takes; ``digs_warp.torch.render`` is `render` for PyTorch.

Importing the package loads nothing, not even NumPy: each name is loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from digs_warp.api.loading import load as load
    from digs_warp.api.reconstructions import reconstruct as reconstruct
    from digs_warp.api.recordings import simulate as simulate
    from digs_warp.api.recordings import stream as stream
    from digs_warp.checks import DigsError as DigsError
    from digs_warp.data.capture import Capture as Capture
    from digs_warp.data.capture_writer import CaptureWriter as CaptureWriter
    from digs_warp.data.capture_writer import FrameImages as FrameImages
    from digs_warp.data.frame import Frame as Frame
    from digs_warp.data.gaussians import Gaussians as Gaussians
    from digs_warp.data.layers import Layer as Layer
    from digs_warp.geometry.camera import Camera as Camera
    from digs_warp.geometry.camera import Intrinsics as Intrinsics
    from digs_warp.geometry.rigid import look_at as look_at
    from digs_warp.pipeline.reconstruction import Reconstruction as Reconstruction
    from digs_warp.sim.record.stream import StereoFrame as StereoFrame
    from digs_warp.sim.sensor.frame import Cause as Cause
    from digs_warp.splat.config import RasterOptions as RasterOptions
    from digs_warp.splat.render import RenderOutput as RenderOutput
    from digs_warp.splat.render import render as render

__version__ = "0.1.0"

# Where each public name is defined.
_HOMES = {
    "Camera": "digs_warp.geometry.camera",
    "Capture": "digs_warp.data.capture",
    "CaptureWriter": "digs_warp.data.capture_writer",
    "Cause": "digs_warp.sim.sensor.frame",
    "DigsError": "digs_warp.checks",
    "Frame": "digs_warp.data.frame",
    "FrameImages": "digs_warp.data.capture_writer",
    "Gaussians": "digs_warp.data.gaussians",
    "Intrinsics": "digs_warp.geometry.camera",
    "Layer": "digs_warp.data.layers",
    "RasterOptions": "digs_warp.splat.config",
    "Reconstruction": "digs_warp.pipeline.reconstruction",
    "RenderOutput": "digs_warp.splat.render",
    "StereoFrame": "digs_warp.sim.record.stream",
    "load": "digs_warp.api.loading",
    "look_at": "digs_warp.geometry.rigid",
    "reconstruct": "digs_warp.api.reconstructions",
    "render": "digs_warp.splat.render",
    "simulate": "digs_warp.api.recordings",
    "stream": "digs_warp.api.recordings",
}
__all__ = list(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
