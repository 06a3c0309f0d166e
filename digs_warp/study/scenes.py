"""What studies measure: the built-in object, meshes of the sample data where it is there; the machine."""

import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.words import counted

# Settings of a recording by the name of the object.
Objects = Mapping[str, Mapping[str, Any]]

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
    "set DIGS_WARP_SAMPLE_DATA to its folder; docs/install.md says where it comes from"
)


def sample_data() -> Path:
    """Return the folder of the sample data: DIGS_WARP_SAMPLE_DATA, or ../shared/data."""
    return Path(os.environ.get("DIGS_WARP_SAMPLE_DATA", "../shared/data"))


def voxel_size(strategy: str) -> float:
    """Return the edge length [m] of the voxels that studies give a strategy of initialization."""
    return COARSE_VOXEL if strategy == "depth" else VOXEL


def objects(count: int, meshes: Sequence[Path] = ()) -> Objects:
    """Return up to ``count`` objects by name, as settings of a recording.

    They are ``meshes``, else sample objects, the built-in object last; without sample data it is alone.

    Raises:
        DigsError: two meshes with the same name.
    """
    data = sample_data()
    environment = data / "envs" / ENVIRONMENT / f"{ENVIRONMENT}_1k.hdr"
    surround = {"environment": environment} if environment.is_file() else {}
    if len({mesh.stem for mesh in meshes}) < len(meshes):
        raise DigsError("--meshes: two files with the same name; results are told apart by it")
    files = list(meshes) or [
        mesh
        for name in SAMPLE_OBJECTS
        if (mesh := data / "meshes" / name / f"{name}.glb").is_file()
    ]
    found: dict[str, dict[str, Any]] = {
        mesh.stem: {"mesh": mesh, "object_size": OBJECT_SIZE} | surround for mesh in files
    }
    if not meshes:
        found[BUILT_IN] = {}
    return dict(list(found.items())[:count])


def processor() -> str:
    """Return the processor's name and number of cores."""
    info = Path("/proc/cpuinfo")
    if not info.is_file():
        return platform.processor() or platform.machine()
    lines = info.read_text(encoding="utf-8").splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    wide = ", AVX-512" if any("avx512f" in line for line in lines) else ""
    return f"{counted(len(names), 'core')} of {names[0] if names else platform.machine()}{wide}"
