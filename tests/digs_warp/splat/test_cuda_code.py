"""The kernels that a CUDA device runs: they compile for one, and what their code tells without a GPU."""

import re
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from digs_warp.device.parallel import launch_parallel, packed
from digs_warp.losses import depth, target
from digs_warp.measure import ssim_pixels
from digs_warp.splat import bin_tiles, blur_renderer, project, shape_gradient
from digs_warp.splat.backend import CooperativeBackend, backend_for
from digs_warp.splat.cooperative import (
    BATCH,
    backward_cooperative_kernel,
    forward_cooperative_kernel,
    sum_records_kernel,
)
from digs_warp.splat.lanes import sums_on_cuda
from digs_warp.splat.records import PairGradients
from digs_warp.train import optimizer

MODULES = (
    *(bin_tiles, project, shape_gradient, blur_renderer),
    *(target, depth, ssim_pixels, optimizer),
)


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__.split(".")[-1])
def test_a_module_compiles_for_cuda(module: object, tmp_path: Path) -> None:
    assert ".target sm_80" in compiled(module, tmp_path)


def compiled(module: object, folder: Path) -> str:
    """The PTX of a module."""
    wp.compile_aot_module(module, arch=80, module_dir=folder, use_ptx=True)  # pyright: ignore
    (code,) = folder.glob("*.ptx")
    return code.read_text()


def shared_bytes(code: str) -> int:
    """Shared memory of a block."""
    return sum(map(int, re.findall(r"^\s*\.shared .*\[(\d+)\];", code, re.MULTILINE)))


FLOAT_ATOMICS = re.compile(r"\b(atom|red)\.\S*\.f32")
COOPERATIVE = {
    "forward": lambda: forward_cooperative_kernel(2),
    "backward": lambda: backward_cooperative_kernel(True),
}


@pytest.mark.parametrize("name", COOPERATIVE)
def test_a_block_shares_records_and_sums_without_atomics(name: str, tmp_path: Path) -> None:
    assert backend_for("cuda:0") == CooperativeBackend()
    code = compiled(COOPERATIVE[name]().module, tmp_path)
    # A batch of records and depths, and its sums; 20 KB leave room for 8 blocks at once.
    assert 4 * BATCH * 3 * 4 <= shared_bytes(code) < 20_480
    assert ".local" not in code  # no variable of a thread lies in global memory
    assert not FLOAT_ATOMICS.search(code)


# Lines of the C++ of `digs_warp.splat.lanes.put_sums`, and what does the same for 32 lanes together.
TRANSLATED = (
    (r"const bool upper = (.*);", r"upper = (\1) != 0"),
    (r"(s\[\d+\] .*);", r"\1"),
    (
        r"if \(upper\) { field \+= (.*); most -= .*; }",
        r"field, most = field + upper * \1, most - upper * \1",
    ),
    (r"else if \(most > (.*)\) .*", r"most = np.where(upper, most, np.minimum(most, \1))"),
    (r"last = last && !\((.*)\);", r"last = last & ((\1) == 0)"),
)


def translated(line: str) -> str:
    found = (match.expand(to) for of, to in TRANSLATED if (match := re.fullmatch(of, line)))
    python = re.sub(r"upper \? (\S+) : ([^,)]+)", r"np.where(upper, \1, \2)", next(found, ""))
    python = re.sub(r"__shfl_xor_sync\(0xffffffffu, (.*), (\d+)\)", r"others(\1, \2)", python)
    return python.replace("0.0f", "np.zeros(32)").replace("+=", "= s[0] +")


@pytest.mark.parametrize("fields", [9, 10])
def test_halves_of_a_warp_add_up_each_field_once(fields: int) -> None:
    shares = np.random.default_rng(fields).integers(-99, 99, (32, fields)).astype(float)
    lane, exchanges = np.arange(32), []

    def others(values: np.ndarray, distance: int) -> np.ndarray:
        exchanges.append(distance)
        return values[lane ^ distance]

    held = {"np": np, "lane": lane, "others": others, "s": list(shares.T), "field": 0 * lane}
    held |= {"most": np.full(32, fields), "last": np.full(32, True)}
    exec("\n".join(map(translated, sums_on_cuda(fields).splitlines())), held)
    writes = held["last"] & (held["most"] > 0)
    assert sorted(held["field"][writes]) == list(range(fields))
    np.testing.assert_array_equal(held["s"][0][writes], shares.sum(axis=0)[held["field"][writes]])
    assert len(exchanges) < fields + 6  # one by one there would be five times as many as fields


def test_only_many_records_of_a_splat_are_added_up() -> None:
    counts = [0, 3, 4, 5, 1, 40]
    starts = np.concatenate([[0], np.cumsum(counts)])
    before = np.random.default_rng(1).normal(size=(starts[-1], 9)).astype(np.float32)
    records = wp.array(before, dtype=float, device="cpu")
    begins = wp.array(starts, dtype=int, device="cpu")
    pairs = packed(PairGradients, starts=begins, records=records)
    launch_parallel(sum_records_kernel(9), 32, [pairs, 4], threads=1)
    expected = before.copy()
    for first, end in ((7, 12), (13, 53)):
        expected[first] = before[first:end].sum(axis=0)
    np.testing.assert_allclose(records.numpy(), expected, rtol=1e-5, atol=1e-5)
