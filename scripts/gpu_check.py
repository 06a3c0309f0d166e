"""Check on a GPU what the test suite can only check on a CPU: the kernels for CUDA.

    python scripts/gpu_check.py                         # all parts on the first GPU
    python scripts/gpu_check.py --only forward,times --json out/gpu.jsonl
    python scripts/gpu_check.py --device cpu            # the same kernels, slowly, on the CPU

It needs nothing but NumPy, SciPy, OpenCV and Warp. Each part runs in a process of its own, so that one that
fails, or hangs, does not take the others along. The last line is PASS or FAIL; the exit code is 1 if a part
failed.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import warp as wp
from gpu_checks import images, learning, machine, timing
from gpu_checks.parts import Findings, Part, Run, append, read, run_part, say

from digs_warp.checks import DigsError
from digs_warp.device.warp_start import require_device

PARTS: dict[str, Part] = {
    "machine": machine.machine,
    "compile": machine.compiling,
    "forward": images.forward,
    "backward": images.backward,
    "ssim": learning.ssim,
    "adam": learning.adam,
    "training": learning.training,
    "determinism": learning.determinism,
    "sizes": machine.sizes,
    "times": timing.times,
}
MOST_SECONDS = 150.0  # for a part; a kernel whose threads wait for each other never ends


def arguments(given: list[str] | None = None) -> argparse.Namespace:
    """Return the settings; sizes default to what the device can do in two minutes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--device", default="cuda:0", help="Warp device, 'cpu' or 'cuda:0'")
    parser.add_argument("--only", default=",".join(PARTS), help="parts, separated by commas")
    parser.add_argument("--splats", type=int, help="of the scenes that are compared")
    parser.add_argument("--size", help="of their images, such as 640x360")
    parser.add_argument("--steps", type=int, help="of the training")
    parser.add_argument("--timed", help="splats of the scenes that are timed, separated by commas")
    parser.add_argument("--timed-size", help="of the images that are timed")
    parser.add_argument("--json", type=Path, help="file to which each part adds a line")
    parser.add_argument("--here", action="store_true", help="run the parts in this process")
    return parser.parse_args(given)


def run_of(settings: argparse.Namespace) -> Run:
    """Return what is checked; on a CPU, blocks of threads are slow, and so all is small."""
    gpu = settings.device != "cpu"
    width, height = pixels(settings.size or ("633x357" if gpu else "121x75"))
    splats = settings.splats or (20_000 if gpu else 1000)
    timed_size = pixels(settings.timed_size or ("1920x1080" if gpu else f"{width}x{height}"))
    timed = settings.timed or ("100000,1000000" if gpu else str(splats))
    return Run(
        *(settings.device, splats, width, height),
        steps=settings.steps or (300 if gpu else 20),
        timed=tuple(int(count) for count in timed.split(",")),
        timed_width=timed_size[0],
        timed_height=timed_size[1],
    )


def pixels(text: str) -> tuple[int, int]:
    """Return width and height of a text such as '640x360' [px]."""
    width, height = text.split("x")
    return int(width), int(height)


def in_own_process(part: str, path: Path, given: list[str]) -> None:
    """Run a part in a process of its own; if that ends without findings, its end is the finding."""
    before = len(read(path))
    command = [sys.executable, __file__, *given, "--here", "--only", part, "--json", str(path)]
    try:
        done = subprocess.run(command, check=False, timeout=MOST_SECONDS)
        ended = f"ended with code {done.returncode}"
    except subprocess.TimeoutExpired:
        ended = f"not done after {MOST_SECONDS:.0f} s"
    if len(read(path)) == before:
        say(f"  {part}: {ended}")
        append(Findings(part, failures=[f"{part}: {ended}"]), path)


def main(given: list[str]) -> int:
    """Run the parts that are wanted; return the exit code."""
    settings = arguments(given)
    names = settings.only.split(",")
    if unknown := sorted(set(names) - set(PARTS)):
        say(f"--only: no part '{unknown[0]}'; there are {', '.join(PARTS)}")
        return 2
    try:
        require_device(settings.device)
    except DigsError as error:
        say(str(error))
        return 2
    with tempfile.TemporaryDirectory(prefix="gpu-check-") as folder:
        path: Path = settings.json or Path(folder) / "findings.jsonl"
        path.parent.mkdir(parents=True, exist_ok=True)
        before = len(read(path))
        if settings.here:
            wp.config.enable_cpu_blocks = True
            for name in names:
                append(run_part(name, PARTS[name], run_of(settings)), path)
        else:
            for name in names:
                in_own_process(name, path, given)
        found = read(path)[before:]
    failures = [failure for findings in found for failure in findings.failures]
    if not settings.here:
        verdict(found, failures)
    return 1 if failures else 0


def verdict(found: list[Findings], failures: list[str]) -> None:
    """Print what was expected, what failed, and PASS or FAIL."""
    seconds = ", ".join(f"{findings.part} {findings.seconds:.0f} s" for findings in found)
    say(f"\nparts: {seconds}")
    say(
        f"expected: images RMS <= {images.MOST_RMS:g}, <= {images.MOST_VISIBLE:g} of the pixels above "
        f"{images.VISIBLE:g} (a pixel at the cut of alpha, or with two splats of nearly one depth, may show "
        f"either); gradients <= {images.MOST_GRADIENT:g}; loss <= {learning.MOST_LOSS:g}, its gradient <= "
        f"{learning.MOST_LOSS_GRADIENT:g}; updates <= {learning.MOST_UPDATE:g}; trainings <= "
        f"{learning.MOST_PSNR_APART:g} dB apart, and better than the start; twice the same bits"
    )
    for failure in failures:
        say(f"failed: {failure}")
    say("FAIL" if failures else "PASS")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
