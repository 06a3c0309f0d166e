"""Simulated recordings: `simulate` makes a whole one, `stream` yields one frame at a time."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from digs_warp.api.settings import with_settings
from digs_warp.commands.output import OutputFolder
from digs_warp.data.capture import Capture, read_capture
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.stream import StereoFrame

if TYPE_CHECKING:
    from digs_warp.api.keywords import SimulateSettings


def simulate(
    mesh: Path | str | None = None,
    frames: int | None = None,
    out: Path | str | None = None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    **settings: Unpack["SimulateSettings"],
) -> Capture:
    """Walk around an object with a simulated stereo depth camera.

        capture = simulate("mug.glb", frames=40, width=320)

    Args:
        mesh: the object: GLB, glTF, OBJ, PLY or STL. Default: the built-in object.
        frames: number of stereo frames. Default: 60.
        out: folder of the capture (docs/formats.md). Default: it stays in memory.
        resume: with ``out``: continue an interrupted run with the same settings.
        overwrite: with ``out``: replace the results of an earlier run once the new ones are complete.
        settings: any other flag of ``digs-warp simulate``, with underscores: ``environment``, ``width``,
            ``tier``, ``effects``, ``seed``, ...

    Raises:
        DigsError: bad input, or a folder that is not empty.
    """
    from digs_warp.sim.record import record

    config = _config(mesh, frames, settings)
    if out is None:
        return record.simulate_in_memory(config)
    output = OutputFolder(out=Path(out), resume=resume, overwrite=overwrite)
    with output.opened(config.input_files) as folder:
        capture = record.simulate(config, folder, resume)
    return read_capture(Path(out)) if overwrite else capture


def stream(
    mesh: Path | str | None = None,
    frames: int | None = None,
    **settings: Unpack["SimulateSettings"],
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


def _config(
    mesh: Path | str | None, frames: int | None, settings: Mapping[str, Any]
) -> SimulateConfig:
    return with_settings(SimulateConfig(), {"mesh": mesh, "frames": frames, **settings})
