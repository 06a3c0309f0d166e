"""Importing stays cheap, and the traps of heavy dependencies stay closed. Each test is a fresh process."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from reference.fresh_process import run_fresh

REPOSITORY = Path(__file__).resolve().parent.parent
FOLDERS = {"digs_warp": "digs_warp", "sim": "digs_warp.sim", "usd": "digs_warp.usd"}

# Slow to load, or in need of system libraries: imported inside functions only.
HEAVY = (
    *("pxr", "pycolmap", "open3d", "pyrender", "torch", "trimesh", "OpenImageIO"),
    *("scipy", "sklearn", "matplotlib", "cv2", "PIL"),
)
MODULES = sorted(
    ".".join([package, *path.relative_to(REPOSITORY / folder).with_suffix("").parts])
    for folder, package in FOLDERS.items()
    for path in (REPOSITORY / folder).rglob("*.py")
    if path.name not in ("__init__.py", "__main__.py")
)


def loaded_after(code: str, modules: Sequence[str]) -> set[str]:
    """Which of ``modules`` a fresh process has loaded after running ``code``."""
    output = run_fresh(f"{code}\nimport sys\nprint('\\n', *sys.modules)").stdout
    return set(modules) & set(output.splitlines()[-1].split())


PARSED = "from digs_warp.cli import parse\nparse(['reconstruct', 'capture', '--out', 'result'])"
OTHER_COMMANDS = [f"digs_warp.commands.{n}" for n in ("simulate", "study", "mesh", "render")]


@pytest.mark.parametrize(
    ("code", "unused"),
    [
        ("import digs_warp, digs_warp.sim, digs_warp.usd", (*HEAVY, "warp", "numpy")),
        ("import digs_warp\ndigs_warp.DigsError\ndigs_warp.Capture", (*HEAVY, "warp", "tyro")),
        ("import digs_warp as dw\ndw.simulate\ndw.reconstruct\ndw.load", (*HEAVY, "warp")),
        # `digs-warp info` on a capture
        ("import digs_warp.check.check, digs_warp.show.report.facts", (*HEAVY, "warp")),
        ("from digs_warp.cli import main\nmain(['--help'])", ("digs_warp.commands.run",)),
        (PARSED, OTHER_COMMANDS),
    ],
)
def test_only_what_is_needed_is_loaded(code: str, unused: Sequence[str]) -> None:
    assert loaded_after(code, unused) == set()


def test_importing_every_module_loads_nothing_heavy() -> None:
    code = f"import importlib\nfor name in {MODULES}: importlib.import_module(name)"
    assert loaded_after(code, HEAVY) == set()


@pytest.mark.parametrize("command", ["", "run", "simulate", "reconstruct", "export-usd", "info"])
def test_help_loads_nothing_heavy(command: str) -> None:
    arguments = [*([command] if command else []), "--help"]
    code = f"from digs_warp.cli import main\nassert main({arguments}) == 0"
    assert loaded_after(code, (*HEAVY, "warp")) == set()
    assert f"usage: {' '.join(['digs-warp', *arguments[:-1]])} [-h]" in run_fresh(code).stdout


def test_images_can_be_written_after_pycolmap_was_loaded(tmp_path: Path) -> None:
    # Loaded before Python's own zlib, pycolmap makes every later PNG write abort the process.
    code = """
import sys
from pathlib import Path
import numpy as np
from digs_warp.device.libraries import import_pycolmap
import_pycolmap()
from digs_warp.data.images import read_image, write_image
pixels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
write_image(Path(sys.argv[1]), pixels)
assert np.array_equal(read_image(Path(sys.argv[1])), pixels)
import zlib
assert zlib.decompress(zlib.compress(pixels.tobytes())) == pixels.tobytes()
"""
    run_fresh(code, tmp_path / "image.png")
