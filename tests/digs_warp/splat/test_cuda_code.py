"""The kernels that a CUDA device runs: they compile for one, and what their code tells without a GPU."""

import re
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from digs_warp.device.parallel import launch_parallel, packed
from digs_warp.losses import depth, target
from digs_warp.measure import ssim_pixels
from digs_warp.splat import (
    bin_tiles,
    blur_renderer,
    project,
    shape_gradient,
)
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

EXCHANGE = r"__shfl_xor_sync\(0xffffffffu, (.*), (\d+)\)"
ADD_HALF = re.compile(rf"s\[(\d+)\] = \(upper \? (\S+) : (\S+)\) \+ {EXCHANGE};")


@pytest.mark.parametrize("name", COOPERATIVE)
def test_a_block_shares_records_and_sums_without_atomics(name: str, tmp_path: Path) -> None:
    assert backend_for("cuda:0") == CooperativeBackend()
    code = compiled(COOPERATIVE[name]().module, tmp_path)
    # A batch of records and depths, and its sums; 20 KB leave room for 8 blocks at once.
    assert 4 * BATCH * 3 * 4 <= shared_bytes(code) < 20_480
    assert ".local" not in code  # no variable of a thread lies in global memory
    assert not FLOAT_ATOMICS.search(code)


class Warp:
    """What 32 lanes hold while they run the C++ of `digs_warp.splat.lanes.put_sums` together."""

    def __init__(self, shares: np.ndarray) -> None:
        self.lane = np.arange(32)
        self.s = list(shares.T.copy())
        self.field = np.zeros(32, dtype=int)
        self.most = np.full(32, shares.shape[1])
        self.last = np.full(32, True)
        self.exchanges = 0

    def value(self, text: str) -> np.ndarray:
        """Evaluate 'upper ? a : b', 's[3]' or a number."""
        if "?" in text:
            yes, no = text.removeprefix("upper ? ").split(" : ")
            return np.where(self.upper, self.value(yes), self.value(no))
        if text.startswith("s["):
            return self.s[int(text[2:-1])]
        return np.full(32, float(text.removesuffix("f")))

    def others(self, text: str, distance: str) -> np.ndarray:
        """Evaluate what the lanes at a distance send."""
        self.exchanges += 1
        return self.value(text)[self.lane ^ int(distance)]

    def run(self, line: str) -> None:
        """Run a line of it."""
        numbers = [int(number) for number in re.findall(r"\d+", line)]
        if found := ADD_HALF.fullmatch(line):
            to, yes, no, sent, distance = found.groups()
            own = np.where(self.upper, self.value(yes), self.value(no))
            self.s[int(to)] = own + self.others(sent, distance)
        elif found := re.fullmatch(rf"s\[0\] \+= {EXCHANGE};", line):
            self.s[0] = self.s[0] + self.others(*found.groups())
        elif line.startswith("const bool upper"):
            self.upper = (self.lane & numbers[0]) != 0
        elif line.startswith("last = "):
            self.last &= (self.lane & numbers[0]) == 0
        elif line.startswith("if (upper)"):
            self.field += np.where(self.upper, numbers[0], 0)
            self.most -= np.where(self.upper, numbers[1], 0)
        elif line.startswith("else if (most >"):
            self.most = np.where(self.upper, self.most, np.minimum(self.most, numbers[1]))


@pytest.mark.parametrize("fields", [9, 10])
def test_halves_of_a_warp_add_up_each_field_once(fields: int) -> None:
    shares = np.random.default_rng(fields).integers(-99, 99, (32, fields)).astype(float)
    warp = Warp(shares)
    for line in sums_on_cuda(fields).splitlines():
        warp.run(line)
    writes = warp.last & (warp.most > 0)
    assert sorted(warp.field[writes]) == list(range(fields))
    np.testing.assert_array_equal(warp.s[0][writes], shares.sum(axis=0)[warp.field[writes]])
    assert warp.exchanges < fields + 6  # one by one there would be five times as many as fields


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
