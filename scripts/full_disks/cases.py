"""The commands that write, each with small inputs."""

from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np

from digs_warp.cli import main
from digs_warp.data.images import write_image
from digs_warp.record.files import write_atomically

# A box in a small panorama loads faster than the built-in object in its room. Without a ground, the masks
# from depth hold all of it: the result has more Gaussians than fit into a page of a disk, also as SPZ.
BOX, SKY = "box.obj", "sky.exr"
SMALL = (
    *("--frames", "4", "--width", "64", "--samples-per-pixel", "1"),
    *("--mesh", f"{{in}}/{BOX}", "--environment", f"{{in}}/{SKY}", "--ground", "none"),
)
SHORT = ("--iterations", "12", "--test-every", "3", "--keep-course", "--masks", "depth")


@dataclass(frozen=True)
class Case:
    """One command line.

    Attributes:
        name: in the table.
        words: the command line; ``{in}`` is the folder of the inputs, ``{out}`` the disk that runs full.
        again: what is added when it runs again after it failed.
        repeats: whether two runs give the same bytes; threads of COLMAP and Open3D add up in any order.
    """

    name: str
    words: str
    again: str = ""
    repeats: bool = True

    def command(self, inputs: Path, disk: Path, again: bool = False) -> list[str]:
        """Return the command line."""
        text = f"{self.words} {self.again if again else ''}"
        return text.replace("{in}", str(inputs)).replace("{out}", str(disk)).split()


CASES = (
    Case("simulate", f"simulate --out {{out}}/a {' '.join(SMALL)}", "--resume"),
    Case("simulate, several", f"simulate --out {{out}}/a {' '.join(SMALL)} --trajectories 2", "--resume"),
    Case("reconstruct", f"reconstruct {{in}}/capture --out {{out}}/a {' '.join(SHORT)}", "--resume"),
    Case(
        "reconstruct, poses estimated",
        f"reconstruct {{in}}/many --out {{out}}/a {' '.join(SHORT)} --poses sfm",
        "--resume",
        repeats=False,
    ),
    Case("run, with report", f"run --out {{out}}/a {' '.join((*SMALL, *SHORT))}", "--resume"),
    Case("plan --json", f"plan --json {{out}}/plan.json {' '.join(SMALL[2:])}"),
    *(
        Case(f"render, {what}", f"render {{in}}/run/reconstruction --out {{out}}/{name} {film}", again)
        for film in ("--seconds 0.4 --width 256 --height 144",)
        for what, name, again in (
            (".mp4", "film.mp4", ""), (".gif", "film.gif", ""), ("images", "film", ""),
        )
    ),
    *(
        Case(
            f"mesh, .{suffix}",
            f"mesh {{in}}/trained --out {{out}}/mesh.{suffix} --voxel-size 0.02",
            repeats=False,
        )
        for suffix in ("glb", "ply")
    ),
    *(
        Case(f"convert, .{suffix}", f"convert {{in}}/run --out {{out}}/scene.{suffix}")
        for suffix in ("npz", "ply", "spz", "splat", "usda", "usdc", "usdz")
    ),
    *(
        Case(f"convert --to {form}", f"convert {{in}}/capture --to {form} --out {{out}}/a")
        for form in ("colmap", "colmap-text", "nerfstudio", "tum", "bop", "redwood")
    ),
    Case("convert --from tum", "convert {in}/tum --from tum --out {out}/a", "--overwrite"),
    *(
        Case(f"export-usd, .{suffix}", f"export-usd {{in}}/run --out {{out}}/scene.{suffix}")
        for suffix in ("usda", "usdc", "usdz")
    ),
    Case(
        "export-usd, capture",
        "export-usd {in}/trained/reconstruction --capture {in}/trained/capture --out {out}/scene.usdz",
    ),
)  # fmt: skip


def find_cases(names: Sequence[str]) -> tuple[Case, ...]:
    """Return the cases of these names; all without names.

    Raises:
        SystemExit: an unknown name.
    """
    unknown = set(names) - {case.name for case in CASES}
    if unknown:
        known = ", ".join(f"'{case.name}'" for case in CASES)
        raise SystemExit(f"{', '.join(sorted(unknown))}: expected {known}")
    return tuple(case for case in CASES if not names or case.name in names)


def make_inputs(folder: Path, cases: Sequence[Case]) -> Path:
    """Make what the cases read below ``folder`` and return it."""
    words = " ".join(case.words for case in cases)
    makers = {
        "run": f"run --out {{in}}/run {' '.join((*SMALL, *SHORT))}",
        "trained": "run --out {in}/trained --frames 8 --width 96 --iterations 150",
        "capture": f"simulate --out {{in}}/capture {' '.join(SMALL)}",
        "many": "simulate --out {in}/many --frames 16 --width 320 --tier law",
        "tum": "convert {in}/capture --to tum --out {in}/tum",
    }
    _make_scene(folder)
    wanted = {name for name in makers if f"{{in}}/{name}" in words}
    if "tum" in wanted:
        wanted.add("capture")
    for name, command in makers.items():
        if name in wanted:
            code, said = run_command(command.replace("{in}", str(folder)).split())
            assert code == 0, said
    return folder


def _make_scene(folder: Path) -> None:
    corners = [(x, y, z) for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.2, 0.2)]
    sides = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    lines = [
        *(f"v {x} {y} {z}" for x, y, z in corners),
        *(f"f {a} {b} {c} {d}" for a, b, c, d in sides),
    ]
    write_atomically(folder / BOX, "\n".join(lines).encode())
    light = np.random.default_rng(0).uniform(0.2, 1.0, (16, 32, 3)).astype(np.float32)
    write_image(folder / SKY, light)


def run_command(words: Sequence[str]) -> tuple[int, str]:
    """Run a command line in this process; return its exit code and what it said on stderr."""
    said = StringIO()
    with redirect_stdout(StringIO()), redirect_stderr(said):
        code = main(words)  # --quiet would silence the warnings of later commands
    return code, said.getvalue()
