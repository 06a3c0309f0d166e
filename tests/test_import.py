"""Importing stays cheap, and the traps of heavy dependencies stay closed. Each test is a fresh process."""

import subprocess
import sys
from pathlib import Path

import pytest

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


def run_python(code: str, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"exit code {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


def loaded_after(code: str, modules: tuple[str, ...]) -> set[str]:
    """Which of ``modules`` a fresh process has loaded after running ``code``."""
    output = run_python(f"{code}\nimport sys\nprint('\\n', *sys.modules)")
    return set(modules) & set(output.splitlines()[-1].split())


@pytest.mark.parametrize("package", FOLDERS.values())
def test_importing_a_package_loads_nothing_heavy(package: str) -> None:
    assert loaded_after(f"import {package}", (*HEAVY, "warp", "numpy")) == set()


@pytest.mark.parametrize(
    ("use", "unused"),
    [
        ("digs_warp.DigsError", ("warp", "tyro")),
        ("digs_warp.Capture", ("warp", "tyro")),
        ("digs_warp.simulate", ("warp",)),
        ("digs_warp.reconstruct", ("warp",)),
        ("digs_warp.load", ("warp",)),
    ],
)
def test_a_public_name_loads_only_what_it_needs(use: str, unused: tuple[str, ...]) -> None:
    assert loaded_after(f"import digs_warp\n{use}", (*HEAVY, *unused)) == set()


def test_importing_every_module_loads_nothing_heavy() -> None:
    code = f"import importlib\nfor name in {MODULES}: importlib.import_module(name)"
    assert loaded_after(code, HEAVY) == set()


@pytest.mark.parametrize("command", ["", "run", "simulate", "reconstruct", "export-usd", "info"])
def test_help_loads_nothing_heavy(command: str) -> None:
    arguments = [*([command] if command else []), "--help"]
    code = f"from digs_warp.cli import main\nassert main({arguments}) == 0"
    assert loaded_after(code, (*HEAVY, "warp")) == set()
    assert f"usage: {' '.join(['digs-warp', *arguments[:-1]])} [-h]" in run_python(code)


def test_the_list_of_commands_loads_none_of_them() -> None:
    code = "import sys\nfrom digs_warp.cli import main\nmain(['--help'])\nprint(len(sys.modules))"
    assert int(run_python(code).splitlines()[-1]) < 400
    assert loaded_after(code, ("digs_warp.commands.run",)) == set()


def test_info_on_a_capture_loads_no_kernels() -> None:
    code = "import digs_warp.check.check, digs_warp.show.report.facts"
    assert loaded_after(code, (*HEAVY, "warp")) == set()


def test_a_command_starts_without_the_others() -> None:
    code = "from digs_warp.cli import parse\nparse(['reconstruct', 'capture', '--out', 'result'])"
    others = ("simulate", "study", "plan", "mesh", "render", "sensor")
    assert loaded_after(code, tuple(f"digs_warp.commands.{name}" for name in others)) == set()


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
    run_python(code, str(tmp_path / "image.png"))
