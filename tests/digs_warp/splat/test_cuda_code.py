"""The kernels that a CUDA device runs: they compile for one, and what their code tells without a GPU."""

import json
import re
from pathlib import Path

import pytest
import warp as wp

from digs_warp.losses import depth, regularizers, target, unknown
from digs_warp.measure import ssim_pixels
from digs_warp.splat import (
    background,
    bin_kernels,
    blur_renderer,
    camera_gradient,
    project,
    project_adjoint,
    skin,
)
from digs_warp.splat.backend import CooperativeBackend, backend_for
from digs_warp.splat.cooperative import (
    BATCH,
    backward_cooperative_kernel,
    forward_cooperative_kernel,
)
from digs_warp.train import optimizer
from reference import plain_raster

MODULES = (
    *(background, bin_kernels, project, project_adjoint, plain_raster),
    *(skin, blur_renderer, camera_gradient),
    *(target, depth, regularizers, unknown, ssim_pixels, optimizer),
)


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__.split(".")[-1])
def test_a_module_compiles_for_cuda(module: object, tmp_path: Path) -> None:
    assert ".target sm_80" in compiled(module, tmp_path)


def compiled(module: object, folder: Path) -> str:
    """The PTX of a module."""
    wp.compile_aot_module(module, arch=80, module_dir=folder, use_ptx=True)  # pyright: ignore
    (code,) = folder.glob("*.ptx")
    return code.read_text()


def shared_bytes(folder: Path) -> int:
    """Shared memory that a block asks for at launch: its tiles."""
    (meta,) = folder.glob("*.meta")
    (size,) = json.loads(meta.read_text()).values()
    return size


FLOAT_ATOMICS = re.compile(r"\b(atom|red)\.\S*\.f32")
COOPERATIVE = {
    "forward": lambda: forward_cooperative_kernel(2, True),
    "backward": lambda: backward_cooperative_kernel(True, True, True),
}


@pytest.mark.parametrize("name", COOPERATIVE)
def test_a_block_shares_records_and_sums_without_atomics(name: str, tmp_path: Path) -> None:
    assert backend_for("cuda:0") == CooperativeBackend()
    code = compiled(COOPERATIVE[name]().module, tmp_path)
    # A batch of records, depths, normals and indices; 16 KB leave room for 8 blocks of 256 threads at once.
    batch = 4 * BATCH * (9 + 1 + 3 + 1)
    assert batch <= shared_bytes(tmp_path) < 16_384
    assert ".local" not in code  # no variable of a thread lies in global memory
    assert not FLOAT_ATOMICS.search(code)


def test_the_plain_kernels_add_with_atomics(tmp_path: Path) -> None:
    assert FLOAT_ATOMICS.search(compiled(plain_raster, tmp_path))
