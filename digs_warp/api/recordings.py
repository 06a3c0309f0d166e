"""Simulated recordings: `simulate` makes a whole one, `stream` yields one frame at a time."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from digs_warp.api.settings import with_settings
from digs_warp.commands.output import capture_files
from digs_warp.data.capture import Capture
from digs_warp.record.replacement import check_place
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.stream import StereoFrame


def simulate(
    mesh: Path | str | None = None,
    frames: int = 20,
    out: Path | str | None = None,
    *,
    resume: bool = False,
    **settings: Any,
) -> Capture:
    """Walk around an object with a simulated stereo depth camera.

        capture = simulate("mug.glb", frames=40, width=320)

    Args:
        mesh: the object: GLB, glTF, OBJ, PLY or STL. Default: the built-in object.
        frames: number of stereo frames.
        out: folder of the capture (docs/formats.md). Default: it stays in memory.
        resume: with ``out``: continue an interrupted run with the same settings.
        settings: the other fields of `digs_warp.sim.config.SimulateConfig`, such as ``environment``,
            ``width``, ``tier``, ``effects``, ``seed``.

    Raises:
        DigsError: bad input, or a folder that holds another recording or other files with names that a
            recording needs.
    """
    from digs_warp.sim.record import record

    config = _config(mesh, frames, settings)
    if out is None:
        return record.simulate_in_memory(config)
    if not resume:
        check_place(Path(out), capture_files())
    return record.simulate(config, Path(out), resume)


def stream(
    mesh: Path | str | None = None, frames: int = 20, **settings: Any
) -> Iterator[StereoFrame]:
    """Yield the frames of the same recording; each is rendered on demand, and none is kept.

        for frame in stream("mug.glb", frames=100, seed=3):
            learn(frame.left, frame.depth, frame.mask)

    Args:
        mesh: see `simulate`.
        frames: number of stereo frames.
        settings: see `simulate`.

    Raises:
        DigsError: bad input.
    """
    from digs_warp.sim.record import stream as sim_stream

    return sim_stream.stream(_config(mesh, frames, settings))


def _config(mesh: Path | str | None, frames: int, settings: dict[str, Any]) -> SimulateConfig:
    return with_settings(SimulateConfig(), {"mesh": mesh, "frames": frames, **settings})
