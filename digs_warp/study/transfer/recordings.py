"""The simulated recordings that something is learned from: hanging, standing, and drawn at random."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.draws import draw_scenes
from digs_warp.sim.record.randomize.file import load_randomization
from digs_warp.sim.record.record import simulate_in_memory
from digs_warp.sim.sensor.filters import gray_of
from digs_warp.study.transfer.matching import KnownPair
from digs_warp.study.transfer.segmentation import DepthFrame

Kind = Literal["hanging", "standing", "random"]
KINDS: tuple[Kind, ...] = ("hanging", "standing", "random")

FRAMES, WIDTH, HEIGHT = 4, 320, 240

# Sample meshes that a seed draws, one in each scene: all of them would take three times as long.
SCENES = 6

# Longest sides of the objects [m]: things that lie on a desk.
SIZES = (0.08, 0.3)


def scenes(data: Path, kind: Kind, base: SimulateConfig, seed: int) -> Iterator[Capture]:
    """Yield a recording for each of some sample meshes, all drawn with ``seed``.

    Args:
        data: folder of the sample data.
        kind: 'hanging': one object in the middle of a sphere; 'standing': one object on the ground;
            'random': scenes of `--randomize indoor`.
        base: camera and filters.
        seed: of meshes, sizes, surrounds and walks.
    """
    meshes = sorted((data / "meshes").glob("*/*.glb"))
    surrounds = sorted((data / "envs").glob("*/*_1k.hdr"))
    small = replace(base, frames=FRAMES, width=WIDTH, height=HEIGHT)
    for config in _settings(kind, small, meshes, surrounds, seed):
        yield simulate_in_memory(config)


def _settings(
    kind: Kind,
    base: SimulateConfig,
    meshes: Sequence[Path],
    surrounds: Sequence[Path],
    seed: int,
) -> Iterator[SimulateConfig]:
    rng = np.random.default_rng(seed)
    meshes = [meshes[number] for number in rng.permutation(len(meshes))[:SCENES]]
    sizes = np.exp(rng.uniform(np.log(SIZES[0]), np.log(SIZES[1]), len(meshes)))
    if kind == "random":
        drawn = replace(base, seed=seed)
        chosen = draw_scenes(load_randomization("indoor"), drawn, len(meshes), meshes, surrounds)
        for scene, size in zip(chosen, sizes, strict=True):
            yield replace(scene.config, object_size=float(size))
        return
    ground = "none" if kind == "hanging" else "auto"
    for number, (mesh, size) in enumerate(zip(meshes, sizes, strict=True)):
        yield replace(
            base,
            mesh=mesh,
            environment=surrounds[int(rng.integers(len(surrounds)))],
            object_size=float(size),
            ground=ground,
            seed=1000 * seed + number,
        )


def depth_frame(frame: Frame) -> DepthFrame:
    """Return sensed depth and the object's mask."""
    depth = np.where(frame.load_depth() > 0, frame.load_depth(), np.nan)
    return DepthFrame(depth, frame.camera.intrinsics.fx, frame.load_mask() >= 128)


def known_pair(frame: Frame, baseline: float) -> KnownPair:
    """Return the recorded pair and its true disparity."""
    disparity = frame.camera.intrinsics.fx * baseline / frame.load_depth_true()
    end = 16 * int(np.ceil((np.nanmax(disparity) + 1) / 16))
    return KnownPair(gray_of(frame.load_image()), gray_of(frame.load_right_image()), disparity, end)
