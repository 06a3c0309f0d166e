"""Compare the hot kernels of this checkout with those of another one: the same bits, and at what speed.

    git worktree add /tmp/before COMMIT
    python scripts/compare_checkouts.py /tmp/before

Each checkout draws the same random splats, computes the loss, back-projects the drawn depth and filters its
edges, in a separate process. The two processes take turns, stage by stage, so that whatever else the
machine does disturbs both. Printed are medians, and the median of the ratios
of neighboring turns; processor time suffers least from other programs. Compilation is not counted.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

# Everything of digs_warp is imported in `Worker`: this file runs on the modules of either checkout.

WIDTH, HEIGHT, SPLATS = 1600, 900, 50_000
NEAR = 0.1
ROUNDS = 15


def say(line: str) -> None:
    """Write a line to stdout at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def random_splats(count: int, degree: int) -> dict[str, np.ndarray]:
    """Return raw parameters of splats of about 3 px that fill the view of `Worker`."""
    rng = np.random.default_rng(0)
    depth = rng.uniform(1.0, 1.5, count)
    px = rng.uniform((-WIDTH / 2, -HEIGHT / 2), (WIDTH / 2, HEIGHT / 2), (count, 2))
    return {
        "means": np.concatenate([px / 1000.0 * depth[:, None], depth[:, None]], axis=1),
        "log_scales": np.log(rng.lognormal(np.log(0.003), 0.5, (count, 3))),
        "quats": rng.normal(size=(count, 4)),
        "opacity_logits": rng.normal(size=count) * 2,
        "sh": rng.normal(size=(count, (degree + 1) ** 2, 3)) * 0.2,
    }


class Worker:
    """Runs the rasterizer that is on the path: answers lines on stdin with lines on stdout."""

    def __init__(self) -> None:
        from digs_warp.geometry.camera import Camera, Intrinsics

        center = WIDTH / 2, HEIGHT / 2
        self.camera = Camera(Intrinsics(WIDTH, HEIGHT, 1000.0, 1000.0, *center), np.eye(4))
        self.hashes = self._hash("color", absolute=False)
        self.hashes |= self._hash("depth", absolute=True, antialias=True)
        self.hashes |= self._hash("normals", absolute=True, camera_gradient=True)
        self.stages = {**self._stages(), **self._initialization()}

    def serve(self) -> None:
        """Print the hashes and the stages, then time each stage that is asked for."""
        say(json.dumps({"hashes": self.hashes, "stages": list(self.stages)}))
        for line in sys.stdin:
            stage = self.stages[line.strip()]
            wall, processor = time.perf_counter(), time.process_time()
            stage()
            seconds = time.perf_counter() - wall, time.process_time() - processor
            say(json.dumps([1e3 * value for value in seconds]))

    def _renderer(self, outputs: str, absolute: bool, camera_gradient: bool, **more: Any) -> Any:
        from digs_warp.splat.config import RasterOptions
        from digs_warp.splat.device import DeviceGaussians, Gaussians, SplatStatistics
        from digs_warp.splat.renderer import SplatRenderer

        splats = DeviceGaussians.from_numpy(Gaussians(**random_splats(SPLATS, degree=2)))
        renderer = SplatRenderer(
            splats,
            WIDTH,
            HEIGHT,
            options=RasterOptions(outputs=outputs, **more),  # pyright: ignore[reportArgumentType]
            camera_gradient=camera_gradient,
        )
        renderer.statistics = SplatStatistics.zeros(SPLATS, absolute=absolute)
        renderer.forward(self.camera, near=NEAR)
        rng = np.random.default_rng(1)
        for planes in (renderer.adj_image, renderer.adj_transmittance):
            planes.assign(rng.normal(size=(HEIGHT, WIDTH, planes.channels)))
        for planes in (renderer.adj_depth, renderer.adj_normals):
            if planes.channels:
                planes.assign(rng.normal(size=(HEIGHT, WIDTH, planes.channels)))
        renderer.backward()
        return renderer

    def _hash(
        self, outputs: str, absolute: bool, camera_gradient: bool = False, **more: Any
    ) -> dict[str, str]:
        """Return a hash of each array that a view and its gradient leave behind."""
        renderer = self._renderer(outputs, absolute, camera_gradient, **more)
        planes = ("image", "transmittance", "depth", "normals")
        arrays = {name: getattr(renderer, name).data.numpy() for name in planes}
        arrays |= {f"d/d {name}": getattr(renderer.gradients, name).numpy() for name in GRADIENTS}
        arrays |= {name: a.numpy() for name, a in vars(renderer.statistics).items()}
        if camera_gradient:
            arrays |= {f"camera {k}": v for k, v in vars(renderer.camera_gradient()).items()}
        return {f"{outputs}: {name}": hash_of(array) for name, array in arrays.items()}

    def _stages(self) -> dict[str, Callable[[], object]]:
        """Return what is timed: the stages of a view, a whole one, and one with a loss, as in training."""
        from digs_warp.losses.photometric import PhotometricLoss
        from digs_warp.losses.regions import loss_blocks

        renderer = self._renderer("color", absolute=False, camera_gradient=False)
        tiles = renderer.binner.drawn_tiles()
        blocks = loss_blocks(tiles, tiles)
        image = renderer.image
        target = type(image)(WIDTH, HEIGHT, 3)
        loss = PhotometricLoss(image, target, renderer.transmittance, renderer.adj_image)

        def step() -> None:
            renderer.forward(self.camera, near=NEAR)
            loss.run((WIDTH, HEIGHT), blocks)
            renderer.backward()

        step()
        self.hashes["loss"] = hash_of(np.array(loss.value()))
        self.hashes["d/d loss"] = hash_of(renderer.adj_image.data.numpy())
        every = self._renderer("normals", absolute=True, camera_gradient=True)
        more = {f"{name}, all outputs": stage for name, stage in every.stages().items()}
        return {
            **renderer.stages(),
            "loss": lambda: loss.run((WIDTH, HEIGHT), blocks),
            "step": step,
            **more,
        }

    def _initialization(self) -> dict[str, Callable[[], object]]:
        """Return the kernels that make points from depth maps."""
        from digs_warp.init.back_project import back_project
        from digs_warp.init.edges import edge_magnitude

        renderer = self._renderer("depth", absolute=False, camera_gradient=False)
        depth = renderer.depth.to_numpy()[..., 0]
        image = (255 * renderer.image.to_numpy().clip(0, 1)).astype(np.uint8)
        keep = depth > 0

        def project() -> Any:
            return back_project(self.camera, image, depth, keep, 0.005, image)

        self.hashes |= {f"voxels: {k}": hash_of(v) for k, v in vars(project()).items()}
        self.hashes["edges"] = hash_of(edge_magnitude(depth)[0])
        return {"back-project": project, "edges": lambda: edge_magnitude(depth)}


def hash_of(array: np.ndarray) -> str:
    """Return a hash of the bits of an array."""
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


GRADIENTS = ("means", "log_scales", "quats", "opacity_logits", "sh")


class Checkout:
    """A `Worker` on the modules of one checkout."""

    def __init__(self, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, Path(__file__).resolve(), "--worker"],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(folder.resolve())},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        found = self._answer()
        self.hashes: dict[str, str] = found["hashes"]
        self.stages: list[str] = found["stages"]

    def time(self, stage: str) -> list[float]:
        """Return how long a stage takes: of the wall's clock and of the processors [ms]."""
        assert self._process.stdin is not None
        self._process.stdin.write(stage + "\n")
        self._process.stdin.flush()
        return self._answer()

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("a checkout could not be measured; its complaint stands above")
        return json.loads(line)


def compare(other: Path, rounds: int) -> None:
    """Print both checkouts side by side."""
    before, now = Checkout(other), Checkout(Path(__file__).resolve().parents[1])
    changed = [name for name in before.hashes if now.hashes.get(name) != before.hashes[name]]
    say(f"arrays compared: {len(before.hashes)}; other bits: {', '.join(changed) or 'none'}\n")
    say(f"{SPLATS:,} splats, {WIDTH}x{HEIGHT} px, medians of {rounds} turns [ms]\n")
    say("| stage | wall before | now | ratio | processors before | now | ratio |")
    say("| --- | --- | --- | --- | --- | --- | --- |")
    for stage in before.stages:
        pair = [before, now]
        times: dict[Checkout, list[list[float]]] = {before: [], now: []}
        for turn in range(rounds + 1):
            for checkout in pair if turn % 2 else pair[::-1]:
                times[checkout].append(checkout.time(stage))
        old, new = np.array(times[before])[1:], np.array(times[now])[1:]  # the first warms up
        ratio = np.median(new / old, axis=0)
        cells = [
            f"{np.median(old[:, k]):.2f} | {np.median(new[:, k]):.2f} | {ratio[k]:.3f}"
            for k in range(2)
        ]
        say(f"| {stage} | {cells[0]} | {cells[1]} |")
    for checkout in (before, now):
        checkout.close()


def main() -> None:
    """Run the comparison, or one side of it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("other", type=Path, nargs="?", help="folder of the other checkout")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="turns of each checkout")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.worker:
        Worker().serve()
    elif arguments.other is None:
        parser.error("name the folder of the other checkout")
    else:
        compare(arguments.other, arguments.rounds)


if __name__ == "__main__":
    main()
