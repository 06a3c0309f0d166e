"""Hash everything that three small runs leave behind; a refactoring must not change a single hash.

    python scripts/result_hashes.py before.json      # at the old commit
    python scripts/result_hashes.py after.json       # at the new one, on the same machine
    diff before.json after.json

Between them the runs reach every stage: three sensors, both sources of poses, four starts and densities,
every loss. Hashed are values (pixels, arrays, USD attributes), not files: settings and times may differ.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.record.files import write_atomically

RUNS: dict[str, str] = {
    "depth": "--frames 12 --width 240 --iterations 60 --keep-course",
    "matched": (
        "--frames 16 --width 320 --tier law --poses sfm --masks depth --strategy fusion "
        "--density adaptive --iterations 120 --depth-weight 0.01 --sh-degree 2 "
        "--min-registered 0.5"
    ),
    "sparse": (
        "--frames 12 --width 320 --tier matcher --effects all --labels all --strategy default "
        "--density adaptive --max-splats 4000 --iterations 120"
    ),
}
# Holds the settings by name: a renamed setting is no other result.
SETTINGS_ATTRIBUTE = ":inputs"
COMMAND = "import sys; from digs_warp.cli import main; sys.exit(main())"


def run(arguments: str, folder: Path) -> None:
    """Run the command line of the code in the working folder.

    On one thread: COLMAP's mapper gives other bits with every schedule of its threads; nothing else does.
    """
    command = [sys.executable, "-c", COMMAND, "run", "--out", str(folder), *arguments.split()]
    environment = os.environ | {"DIGS_WARP_THREADS": "1"}
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)


def hash_of(*parts: Any) -> str:
    """Return a hash of arrays: shape, type and bytes."""
    digest = hashlib.sha256()
    for part in parts:
        values = np.ascontiguousarray(part)
        digest.update(f"{values.shape} {values.dtype}".encode() + values.tobytes())
    return digest.hexdigest()[:16]


def hash_of_images(folder: Path) -> str:
    """Return a hash of the pixels of all images in a folder."""
    import OpenImageIO as oiio

    return hash_of(*(oiio.ImageBuf(str(path)).get_pixels() for path in sorted(folder.iterdir())))


def hash_of_arrays(path: Path) -> str:
    """Return a hash of all arrays in an .npz."""
    with np.load(path, allow_pickle=False) as arrays:
        return hash_of(*(arrays[name] for name in sorted(arrays)))


def hash_of_scene(path: Path) -> str:
    """Return a hash of every attribute of a USD scene, in every variant and at every time."""
    from pxr import Usd

    digest = hashlib.sha256()
    stage = Usd.Stage.Open(str(path))
    for prim in stage.TraverseAll():
        for attribute in prim.GetAttributes():
            if attribute.GetName().endswith(SETTINGS_ATTRIBUTE):
                continue
            times = attribute.GetTimeSamples() or [Usd.TimeCode.Default()]
            for time in times:
                value = attribute.Get(time)
                content = np.asarray(value).tobytes() if hasattr(value, "__len__") else repr(value)
                digest.update(f"{attribute.GetPath()} {time} ".encode())
                digest.update(content if isinstance(content, bytes) else content.encode())
    return digest.hexdigest()[:16]


def hashes(folder: Path) -> dict[str, str]:
    """Return the hashes of what a run left in ``folder``."""
    capture, result = folder / "capture", folder / "reconstruction"
    layers = sorted(path for path in capture.iterdir() if path.is_dir())
    return {
        **{f"capture/{layer.name}": hash_of_images(layer) for layer in layers},
        "initial points": hash_of_arrays(result / "initial_points.npz"),
        "Gaussians": hash_of_arrays(result / "gaussians.npz"),
        "renders": hash_of_images(result / "renders"),
        "scene": hash_of_scene(folder / "scene.usdz"),
    }


def main() -> None:
    """Make the runs and write their hashes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("output", type=Path)
    found: dict[str, dict[str, str]] = {}
    output = parser.parse_args().output
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in RUNS.items():
            run(arguments, Path(folder) / name)
            found[name] = hashes(Path(folder) / name)
    write_atomically(output, (json.dumps(found, indent=2) + "\n").encode())


if __name__ == "__main__":
    main()
