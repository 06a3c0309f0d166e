"""The objects that studies record: the built-in one, and meshes of the sample data where it is present."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.sim.config import SimulateConfig

BUILT_IN = "built-in vase"

# Smooth and rough, textured and plain, thin and solid: what initializations differ on.
SAMPLE_OBJECTS = (
    *("ycb_mustard_bottle", "avocado", "spot"),
    *("ycb_cracker_box", "armchair", "flight_helmet"),
)
# All objects have the built-in one's longest side [m]: results compare, and the camera is about a metre away,
# where it measures well.
OBJECT_SIZE = 0.5
# Voxels [m] of studies and benchmarks where they do not vary: the same for all image sizes.
VOXEL, COARSE_VOXEL = 0.004, 0.01
# Rich in texture: structure from motion needs the surround.
ENVIRONMENT = "forest_slope"
# What to do where it is missing.
SEE_SAMPLE_DATA = (
    "set DIGS_WARP_SAMPLE_DATA to its folder; docs/sample-data.md says where it comes from"
)


def sample_data() -> Path:
    """Return the folder of the sample data: DIGS_WARP_SAMPLE_DATA, or ../shared/data."""
    return Path(os.environ.get("DIGS_WARP_SAMPLE_DATA", "../shared/data"))


def voxel_size(strategy: str) -> float:
    """Return the edge length [m] of the voxels that studies give a strategy of initialization."""
    return COARSE_VOXEL if strategy == "depth" else VOXEL


def with_meshes(
    recording: SimulateConfig, meshes: Sequence[str], data: Path | None, bench: str
) -> dict[str, SimulateConfig]:
    """Return the recording of each sample mesh that is there, by its name.

    Args:
        recording: of every mesh.
        meshes: names of sample meshes.
        data: folder of the sample data; None: DIGS_WARP_SAMPLE_DATA or ../shared/data.
        bench: the benchmark that asks, for the message.

    Raises:
        DigsError: none of the meshes is there.
    """
    data = data or sample_data()
    present = [mesh for mesh in meshes if (data / "meshes" / mesh).is_dir()]
    if not present:
        raise DigsError(f"bench {bench}: no sample meshes in '{data}'; {SEE_SAMPLE_DATA}")
    surround = data / "envs" / ENVIRONMENT / f"{ENVIRONMENT}_1k.hdr"
    environment = surround if surround.is_file() else None
    return {
        mesh: replace(
            recording, mesh=data / "meshes" / mesh / f"{mesh}.glb", environment=environment
        )
        for mesh in present
    }


def objects(count: int, first: Sequence[str] = ()) -> dict[str, dict[str, Any]]:
    """Return ``count`` objects by name, as settings of a recording.

    Without sample data there is the built-in object alone.

    Args:
        count: how many; the built-in object comes last.
        first: sample objects that come before the others.
    """
    data = sample_data()
    environment = data / "envs" / ENVIRONMENT / f"{ENVIRONMENT}_1k.hdr"
    surround = {"environment": environment} if environment.is_file() else {}
    found: dict[str, dict[str, Any]] = {}
    for name in dict.fromkeys((*first, *SAMPLE_OBJECTS)):
        mesh = data / "meshes" / name / f"{name}.glb"
        if mesh.is_file():
            found[name] = {"mesh": mesh, "object_size": OBJECT_SIZE} | surround
    found[BUILT_IN] = {}
    return dict(list(found.items())[:count])
