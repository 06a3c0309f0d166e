"""`digs-warp simulate`: mesh and environment -> a capture folder."""

import time
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import tyro

from digs_warp.commands.output import OutputFolder
from sim.config import SimulateConfig


@dataclass(frozen=True, kw_only=True)
class Simulate:
    """Record an object with a simulated handheld stereo depth camera.

    Writes a capture folder: left and right images, depth, masks and poses. nerfstudio reads it, too.
    """

    output: Annotated[OutputFolder, tyro.conf.OmitArgPrefixes]
    recording: Annotated[SimulateConfig, tyro.conf.OmitArgPrefixes] = field(
        default_factory=SimulateConfig
    )

    can_resume: ClassVar[bool] = True

    def execute(self) -> str:
        """Record and say what was recorded."""
        from sim.record import simulate

        start = time.perf_counter()
        folder = self.output.prepare(inputs=[self.recording.mesh, self.recording.environment])
        capture = simulate(self.recording, folder, resume=self.output.resume)
        k = capture.frames[0].camera.intrinsics
        seconds = time.perf_counter() - start
        return f"{folder}: {len(capture)} frames of {k.width} x {k.height} in {seconds:.1f} s"
