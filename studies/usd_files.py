"""`python -m studies usd`: USD scenes of a million splats, and what each precision costs and loses.

Speed: random splats of degree 3 are written to a new file, read back to Gaussians, and validated with our
rules and those of OpenUSD; the best of several rounds, with the file in the page cache. "np.save" and
"np.load" are the floor of this machine: NumPy's time for as many bytes. Memory is the peak growth of a fresh
process, mapped files included. PSNR: a smaller scene is written, read, rendered, and compared with what
was written.
"""

import importlib.util
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import get_args

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.record.progress import progress
from digs_warp.splat.render import render
from digs_warp.usd.convert import Precision
from digs_warp.usd.reader import read_gaussians
from digs_warp.usd.validate import validate
from digs_warp.usd.writer import WriteOptions, write_gaussians
from studies.results import Result
from studies.timing import best_ms, peak_memory

SPLATS = 1_000_000
PICTURED_SPLATS = 100_000
DEGREE = 3
REPEATS = 5
_VIEWS = 3

# Bytes per splat of each array at full precision: position, quaternion, scales, opacity, coefficients.
_FLOAT_BYTES = {"position": 12, "others": 16 + 12 + 4 + 12 * (DEGREE + 1) ** 2}


def bench_usd(splats: int = SPLATS, pictured: int = PICTURED_SPLATS) -> list[Result]:
    """Return times [s], sizes and the PSNR of rendered views [dB] for every precision and format."""
    large, small = random_splats(splats), random_splats(pictured)
    pictures = _views_of(small)
    precisions: tuple[Precision, ...] = get_args(Precision)
    results: list[Result] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        progress(2 * len(precisions), "Measuring", "case") as bar,
    ):
        for precision in precisions:
            psnr = _psnr(pictures, _views_of(_stored(small, Path(folder), precision)))
            for suffix in ("usdc", "usdz"):
                path = Path(folder) / f"scene.{suffix}"
                labels = {"precision": precision, "format": suffix}
                labels |= {"splats": splats, "degree": DEGREE}
                values = _measure(large, path, precision) | {"PSNR [dB]": psnr}
                results.append(Result(labels, values))
                path.unlink()
                bar.update()
    return results


def _stored(gaussians: Gaussians, folder: Path, precision: Precision) -> Gaussians:
    """Return Gaussians as they come back from a file."""
    path = folder / "small.usdc"
    write_gaussians(path, gaussians, options=WriteOptions(precision=precision))
    return read_gaussians(path)


def _measure(gaussians: Gaussians, path: Path, precision: Precision) -> dict[str, float]:
    """Return times, peak memory and size of one file."""
    options = WriteOptions(precision=precision)

    def write() -> None:
        write_gaussians(path, gaussians, options=options)

    # A new file each time: replacing one also costs the deletion of the old.
    times = {"write": best_ms(write, REPEATS, lambda: path.unlink(missing_ok=True))}
    size = path.stat().st_size
    times |= _floor(path.with_name("floor.npy"), size)
    times["read"] = best_ms(lambda: read_gaussians(path), REPEATS)
    # NVIDIA's rule, where installed, takes seconds in Python loops and would hide ours.
    if importlib.util.find_spec("usd_validation_nvidia") is None:
        times["validate"] = best_ms(lambda: validate(path), REPEATS)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as fresh:
        peaks = fresh.submit(_peaks, len(gaussians), path, precision).result()
    halves = {"float": (), "mixed": ("others",), "half": ("position", "others")}[precision]
    per_splat = sum(b // 2 if name in halves else b for name, b in _FLOAT_BYTES.items())
    return {
        **{f"{name} [s]": value / 1e3 for name, value in times.items()},
        **{f"{name} [MB]": value / 1e6 for name, value in peaks.items()},
        "size [MB]": size / 1e6,
        "beyond arrays [B]": size - per_splat * len(gaussians),
    }


def _peaks(splats: int, path: Path, precision: Precision) -> dict[str, int]:
    """Return the peak growth while writing a new file and reading it [bytes].

    Call it in a fresh process: one that has written before reuses memory that it never gave back.
    """
    options = WriteOptions(precision=precision)
    write_gaussians(path, random_splats(10), options=options)  # the libraries are loaded by now
    read_gaussians(path)
    path.unlink()
    gaussians = random_splats(splats)
    with peak_memory() as writing:
        write_gaussians(path, gaussians, options=options)
    with peak_memory() as reading:
        read_gaussians(path)
    return {"write memory": writing.growth, "read memory": reading.growth}


def _floor(path: Path, size: int) -> dict[str, float]:
    """Return how long NumPy takes to save and load ``size`` bytes [ms]."""
    content = np.ones(size, dtype=np.uint8)
    seconds = {
        "np.save": best_ms(
            lambda: np.save(path, content), REPEATS, lambda: path.unlink(missing_ok=True)
        ),
        "np.load": best_ms(lambda: np.load(path), REPEATS),
    }
    path.unlink()
    return seconds


def random_splats(count: int) -> Gaussians:
    """Return splats all over a cubic metre, of every shape, with colors that change with the direction."""
    rng = np.random.default_rng(0)
    size = count ** (-1 / 3)  # about as large as they are apart
    sh = rng.normal(0.0, 0.1, (count, (DEGREE + 1) ** 2, 3))
    sh[:, 0] = rng.normal(0.0, 0.8, (count, 3))
    return Gaussians(
        means=rng.uniform(-0.5, 0.5, (count, 3)),
        log_scales=rng.normal(np.log(0.4 * size), 0.7, (count, 3)),
        quats=rng.normal(size=(count, 4)),
        opacity_logits=rng.normal(0.0, 2.0, count),
        sh=sh,
    )


def _views_of(gaussians: Gaussians) -> list[np.ndarray]:
    """Render the cube from all sides."""
    intrinsics = Intrinsics.from_fov(640, 360, 50.0)
    up = np.array([0.0, 0.0, 1.0])
    eyes = [
        2.0 * np.array([np.cos(angle), np.sin(angle), 0.4])
        for angle in 2 * np.pi * np.arange(_VIEWS) / _VIEWS
    ]
    return [
        render(gaussians, Camera(intrinsics, look_at(eye, np.zeros(3), up))).image for eye in eyes
    ]


def _psnr(expected: list[np.ndarray], found: list[np.ndarray]) -> float:
    """Return the PSNR over all views [dB], capped at 120: the pictures are float32."""
    error = np.mean(
        [((a - b) ** 2).mean(dtype=np.float64) for a, b in zip(expected, found, strict=True)]
    )
    return float(min(120.0, -10 * np.log10(max(error, 1e-12))))
