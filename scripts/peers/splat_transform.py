"""Read our splat files with splat-transform of PlayCanvas, and its files with ours; print what differs.

    npm install --prefix /tmp/peer @playcanvas/splat-transform
    python -m scripts.peers.splat_transform /tmp/peer/node_modules/.bin/splat-transform --splats 2000

Its PLY of our file has to hold what we read of the same file; its file of our PLY what it was made of, to
the precision of the format. It does not read glTF. In glTF its splats are turned by half a turn about z: it
takes y in a PLY for down.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree  # pyright: ignore[reportAttributeAccessIssue]

from digs_warp.data.gaussians import Gaussians
from digs_warp.formats.splats.files import WORLD_FROM_UP, read_splat_file, turned, write_splat_file

# Its SOG does not keep the color of fainter ones.
LEAST_OPACITY = 0.5 / 255
HALF_TURN = np.diag([-1.0, -1.0, 1.0])


def random_splats(count: int) -> Gaussians:
    """Return splats of every shape all over a cubic metre, with colors of degree 3."""
    rng = np.random.default_rng(0)
    size = count ** (-1 / 3)  # about as large as they are apart
    sh = rng.normal(0.0, 0.1, (count, 16, 3))
    sh[:, 0] = rng.normal(0.0, 0.8, (count, 3))
    return Gaussians(
        means=rng.uniform(-0.5, 0.5, (count, 3)),
        log_scales=rng.normal(np.log(0.4 * size), 0.7, (count, 3)),
        quats=rng.normal(size=(count, 4)),
        opacity_logits=rng.normal(0.0, 2.0, count),
        sh=sh,
    )


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program", help="splat-transform")
    parser.add_argument("--splats", type=int, default=2000)
    arguments = parser.parse_args()

    def convert(source: Path, target: Path) -> Gaussians:
        command = [arguments.program, "-q", "-w", "-g", "cpu", source, target]
        subprocess.run([*map(str, command)], check=True, capture_output=True)
        return read_splat_file(target)

    with tempfile.TemporaryDirectory() as folder:
        ply = Path(folder) / "a.ply"
        splats = random_splats(arguments.splats)
        write_splat_file(ply, splats)
        for suffix in (".compressed.ply", ".sog"):
            ours = Path(folder) / f"ours{suffix}"
            write_splat_file(ours, splats)
            read, theirs = read_splat_file(ours), convert(ours, Path(folder) / "theirs.ply")
            sys.stdout.write(f"ours{suffix}, their reading to ours: {difference(theirs, read)}\n")
        for suffix in (".compressed.ply", ".sog", ".glb"):
            theirs = convert(ply, Path(folder) / f"theirs{suffix}")
            source = splats
            if suffix == ".glb":
                source = turned(splats, WORLD_FROM_UP["y"] @ HALF_TURN)
            words = difference(theirs, source)
            sys.stdout.write(f"theirs{suffix}, our reading to the source: {words}\n")


def difference(one: Gaussians, other: Gaussians) -> str:
    """Return the largest differences of the nearest splats, in words; colors of those that are seen."""
    distance, places = KDTree(other.means).query(one.means)
    other = other.select(np.asarray(places))
    scales = np.abs(one.log_scales - other.log_scales).max()
    opacities = np.abs(one.opacities - other.opacities).max()
    seen = one.opacities > LEAST_OPACITY
    colors = np.abs(one.sh[:, 0] - other.sh[:, 0])[seen].max()
    return (
        f"{len(one)} splats, centers {distance.max():.2g}, log-scales {scales:.2g}, opacities "
        f"{opacities:.2g}, colors {colors:.2g}"
    )


if __name__ == "__main__":
    main()
