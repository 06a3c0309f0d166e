"""`python -m studies poses`: what poses that nobody knows cost, on simulated scenes.

Every scene is reconstructed with its true poses, and with poses from images, from color and depth, and from
what `--poses auto` chooses. A way that fails is a row without figures, and its error is among the findings.

Found poses have the scale of the depth, and a stereo camera measures that with an error. What this costs is
no error of the poses, so the true poses are reconstructed in the found scale as well.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.images import write_image
from digs_warp.data.sfm_model import scaled_pose
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.progress import progress
from digs_warp.sim.camera.walk.settings import PathName, WalkSettings
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.engine.placement import pose_pixels
from digs_warp.study.scenes import ENVIRONMENT, OBJECT_SIZE, SEE_SAMPLE_DATA, sample_data
from studies.recordings import (
    FIGURES,
    FINDINGS,
    POSES,
    Notes,
    Poses,
    reconstructed,
    reconstructions,
)
from studies.results import Result

FRAMES, WIDTH, ITERATIONS = 24, 320, 300
# Of the camera above the horizon [degree].
ELEVATION = 30.0

# Noise in tiles, this many of them all round; and how bright white walls are, with a faint gradient.
TILES, TILE_PX = 20, 64
WHITE, GRADIENT = 228, 8

# Poses that move the object farther in the images are plainly wrong [px].
LOST = 5.0

LOSS = "below true poses [dB]"
IN_SCALE = "below true poses in its scale [dB]"

# A second table, for one with all columns would be too wide to read: how far the poses are off, and the time.
POSES_AND_TIME = "poses"
ITS_COLUMNS = (
    *("pose error [cm]", "pose error [deg]", "pose error [px]", "scale error [%]"),
    *("frames", "held out", "Gaussians", "seconds", "CPU [s]"),
)


@dataclass(frozen=True)
class PosedScene:
    """A scene whose poses are found.

    Attributes:
        name: as the table shows it.
        mesh: a sample mesh.
        wall: what is around it: that of the other benchmarks, a repeating pattern, or white.
        path: of the camera: to and fro on an arc, about 5 degrees between frames; or on an orbit, 15.
        aside: nothing of the way to find poses was fitted to it.
    """

    name: str
    mesh: str
    wall: str
    path: PathName
    aside: bool


SCENES = (
    PosedScene("armchair, repeating wall", "armchair", "repeating", "arc", False),
    PosedScene(
        "mustard bottle, white room, wide steps", "ycb_mustard_bottle", "white", "orbits", False
    ),
    PosedScene("boot, white room", "boot_plain", "white", "arc", True),
    PosedScene("metal case, wide steps", "sci_fi_case", "textured", "orbits", True),
    PosedScene("helmet, white room, wide steps", "flight_helmet", "white", "orbits", True),
)


def bench_found_poses(
    only: Sequence[str] = (),
    data: Path | None = None,
    scenes: Sequence[PosedScene] = SCENES,
    recording: SimulateConfig | None = None,
    iterations: int = ITERATIONS,
) -> list[Result]:
    """Return the figures of every scene with each kind of poses, and what went wrong.

    Args:
        only: meshes of scenes; none: all of them.
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        scenes: which.
        recording: settings of all recordings; None: those of the published table.
        iterations: training steps.
    """
    recording = recording or SimulateConfig(frames=FRAMES, width=WIDTH, object_size=OBJECT_SIZE)
    scenes = [scene for scene in scenes if not only or scene.mesh in only]
    meshes = with_meshes(recording, [scene.mesh for scene in scenes], data)
    present = [scene for scene in scenes if scene.mesh in meshes]
    results: list[Result] = []
    with progress(len(present), "Measuring", "scene") as bar:
        for scene in present:
            with tempfile.TemporaryDirectory() as folder:
                results += _measured(scene, meshes[scene.mesh], Path(folder), iterations)
            bar.update()
    order = (FIGURES, POSES_AND_TIME, FINDINGS)
    parts = [part for row in results for part in _in_two_tables(row)]
    return sorted(parts, key=lambda part: order.index(part.table))


def with_meshes(
    recording: SimulateConfig, meshes: Sequence[str], data: Path | None
) -> dict[str, SimulateConfig]:
    """Return the recording of each sample mesh that is there, by its name.

    Args:
        recording: of every mesh.
        meshes: names of sample meshes.
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.

    Raises:
        DigsError: none of the meshes is there.
    """
    data = data or sample_data()
    present = [mesh for mesh in meshes if (data / "meshes" / mesh).is_dir()]
    if not present:
        raise DigsError(f"poses: no sample meshes in '{data}'; {SEE_SAMPLE_DATA}")
    surround = data / "envs" / ENVIRONMENT / f"{ENVIRONMENT}_1k.hdr"
    environment = surround if surround.is_file() else None
    return {
        mesh: replace(
            recording, mesh=data / "meshes" / mesh / f"{mesh}.glb", environment=environment
        )
        for mesh in present
    }


def _in_two_tables(row: Result) -> list[Result]:
    """Return a row of figures as one for each of its tables; findings stay as they are."""
    if row.table != FIGURES:
        return [row]
    quality = {name: value for name, value in row.values.items() if name not in ITS_COLUMNS}
    others = {name: row.values[name] for name in ITS_COLUMNS if name in row.values}
    return [replace(row, values=quality), replace(row, values=others, table=POSES_AND_TIME)]


def _measured(
    scene: PosedScene, recording: SimulateConfig, folder: Path, iterations: int
) -> list[Result]:
    if scene.wall != "textured":
        recording = replace(recording, environment=_wall(scene.wall, folder / "wall.png"))
    walk = WalkSettings(path=scene.path, elevations=(ELEVATION,))
    capture = simulate(replace(recording, walk=walk), folder / "capture")
    notes = Notes(scene.name, folder, iterations)
    ways: tuple[Poses, ...] = tuple(POSES)
    for result in reconstructions(capture, ways, notes):
        row = notes.results[-1]
        if row.labels["poses"] != POSES["capture"]:
            more = _beyond_centers(result, capture, row.values["PSNR [dB]"], notes)
            notes.results[-1] = replace(row, values=dict(row.values) | more)
    first, *others = notes.results
    return [_compared(row, first, scene.aside) for row in (first, *others)]


def _beyond_centers(
    result: Reconstruction, capture: Capture, psnr: float, notes: Notes
) -> dict[str, float]:
    """Return what found poses do to the images, their scale, and their loss to true ones in that scale."""
    assert result.frames is not None
    apart = pose_pixels(capture.frames, [frame for frame, _ in result.frames.by_time])
    values = {"pose error [px]": apart.error, "scale error [%]": 100 * (apart.scale - 1)}
    if apart.error > LOST:  # poses that are plainly wrong have no scale to speak of
        return values
    scaled = replace(capture, frames=tuple(_scaled(frame, apart.scale) for frame in capture.frames))
    with tempfile.TemporaryDirectory() as folder:
        _, true = reconstructed(scaled, "capture", notes.iterations, Path(folder))
    return values | {IN_SCALE: true["PSNR [dB]"] - psnr}


def _scaled(frame: Frame, scale: float) -> Frame:
    """Return a frame of a world that is larger by ``scale``; its depth stays."""
    pose = scaled_pose(frame.camera, 1 / scale)
    return replace(frame, camera=replace(frame.camera, world_from_cam=pose))


def _compared(row: Result, with_true_poses: Result, aside: bool) -> Result:
    """Return a row with what it lacks to that with true poses, and whether the scene was kept aside."""
    if row.table != FIGURES:
        return row
    values, true = dict(row.values), with_true_poses.values
    if row is not with_true_poses and "PSNR [dB]" in values and "PSNR [dB]" in true:
        values[LOSS] = true["PSNR [dB]"] - values["PSNR [dB]"]
    labels = {**row.labels, "kept aside": "yes" if aside else "no"}
    return replace(row, labels=labels, values=values)


def _wall(kind: str, path: Path) -> Path:
    """Write the environment of a room."""
    if kind == "white":
        across = np.cos(np.linspace(0, 2 * np.pi, 128))[None, :, None]
        pixels = np.broadcast_to(WHITE + GRADIENT * across, (64, 128, 3))
    else:
        rng = np.random.default_rng(1)
        blocks = rng.uniform(40, 230, (TILE_PX // 4, TILE_PX // 4, 3))
        pixels = np.tile(blocks.repeat(4, 0).repeat(4, 1), (TILES // 2, TILES, 1))
    write_image(path, np.ascontiguousarray(pixels.astype(np.uint8)))
    return path
