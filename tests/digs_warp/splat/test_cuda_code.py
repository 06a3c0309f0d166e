"""The kernels that a CUDA device runs compile for one: all that can be checked without a GPU."""

from pathlib import Path

import pytest
import warp as wp

from digs_warp.splat import (
    background,
    bin_kernels,
    plane_kernels,
    project,
    project_adjoint,
    rasterize_reference,
)

MODULES = (background, bin_kernels, plane_kernels, project, project_adjoint, rasterize_reference)


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__.split(".")[-1])
def test_a_module_compiles_for_cuda(module: object, tmp_path: Path) -> None:
    wp.compile_aot_module(module, arch=80, module_dir=tmp_path, use_ptx=True)  # pyright: ignore
    (code,) = tmp_path.glob("*.ptx")
    assert ".target sm_80" in code.read_text()
