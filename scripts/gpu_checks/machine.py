"""The device, the time to compile, and sizes at which something might break."""

import shutil
import subprocess
import time

import numpy as np
import warp as wp

from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.device.warp_start import compile_seconds
from digs_warp.splat.config import RasterOptions
from digs_warp.splat.device import DeviceGaussians
from digs_warp.splat.renderer import SplatRenderer
from gpu_checks.images import CASES, Views
from gpu_checks.learning import make_training
from gpu_checks.parts import Findings, Run
from gpu_checks.scenes import NEAR, body_in_room, cameras


def machine(run: Run, findings: Findings) -> None:
    """Say what is checked."""
    device = wp.get_device(run.device)
    findings.note("device", device.name)
    findings.note("Warp", wp.config.version)
    if not run.has_gpu:
        findings.note(
            "what is compared", "the kernels for CUDA, run on the CPU, with those for CPUs"
        )
        return
    findings.note("compute capability", f"{device.arch / 10:.1f}")
    findings.note("memory [GB]", device.total_memory / 1e9)
    findings.note("memory pools", device.is_mempool_enabled)
    query = ["nvidia-smi", "--query-gpu=name,driver_version,clocks.sm,clocks.max.sm"]
    if shutil.which(query[0]):
        query.append("--format=csv,noheader")
        said = subprocess.run(query, check=False, capture_output=True, text=True)
        findings.note("nvidia-smi: name, driver, clock, highest clock", said.stdout.strip())


def compiling(run: Run, findings: Findings) -> None:
    """Use every kernel once; the time is that of the first use on this machine."""
    start = time.perf_counter()
    small = Run(run.device, 50, 40, 30, 1, (), 0, 0)
    camera = cameras(1, small.width, small.height)[0]
    for case in CASES:
        if run.has_gpu or case.blur is None:

            def draw(case=case) -> None:
                views = Views(small, case, camera)
                views.gradients(views.tried)

            findings.attempt(case.name, draw)
    findings.attempt(
        "training",
        lambda: make_training(small, run.device, run.backend, 50, (40, 30)).step(),
    )
    wp.synchronize()
    findings.note("all kernels once [s]", time.perf_counter() - start)
    findings.note("compilers, of that [s]", compile_seconds())


def sizes(run: Run, findings: Findings) -> None:
    """Draw and pull back at sizes at which something might break; all has to be finite."""
    some = body_in_room(100)
    large = (3840, 2160) if run.has_gpu else (400, 300)
    behind = Gaussians(**{**vars(some), "means": some.means + [50.0, 0.0, 0.0]})
    trials: dict[str, tuple[Gaussians, tuple[int, int]]] = {
        "one splat": (body_in_room(1), (64, 48)),
        "no splat": (body_in_room(0), (64, 48)),
        "all behind the camera": (behind, (64, 48)),
        "one pixel": (some, (1, 1)),
        "one column": (some, (1, 70)),
        "one tile": (some, (16, 16)),
        f"{large[0]}x{large[1]} px": (body_in_room(run.splats), large),
    }
    for name, (scene, size) in trials.items():
        findings.attempt(name, lambda t=(name, scene, size): _draw(run, *t, findings))


def _draw(run: Run, name: str, scene: Gaussians, size: tuple[int, int], findings: Findings) -> None:
    gaussians = DeviceGaussians.from_numpy(scene, run.device)
    options = RasterOptions(outputs="depth")
    renderer = SplatRenderer(gaussians, *size, options=options, backend=run.backend)
    camera = cameras(1, *size)[0]
    renderer.forward(camera, near=NEAR)
    for adjoint in (renderer.adj_image, renderer.adj_transmittance, renderer.adj_depth):
        adjoint.assign(np.ones((size[1], size[0], adjoint.channels)))
    renderer.backward()
    arrays = [renderer.image.to_numpy(), renderer.depth.to_numpy()]
    arrays += [array.numpy() for array in renderer.gradients.arrays]
    finite = all(np.isfinite(array).all() for array in arrays)
    findings.require(f"{name}: finite", finite)
    if name in ("no splat", "all behind the camera"):
        nothing = all(not getattr(renderer.gradients, field).numpy().any() for field in FIELDS)
        white = bool((renderer.image.to_numpy() == 1.0).all())
        findings.require(f"{name}: only background, no gradient", nothing and white)
