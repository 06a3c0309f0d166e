"""`digs-warp bench view`: how fast the page draws, and what watching a training costs.

Frames are drawn and encoded as for a browser; sending and showing them is the browser's part. A training is
run as a command: alone, with `--view`, and with `--view` and a browser that looks, in turn.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.geometry.camera import Intrinsics
from digs_warp.init.config import InitConfig
from digs_warp.init.recipes import initial_points
from digs_warp.init.seed_gaussians import seed_gaussians
from digs_warp.record.progress import progress
from digs_warp.show.film.camera_path import find_subject, orbit
from digs_warp.show.view.server import FIRST_PORT
from digs_warp.show.view.streamer import TrueRenderer, put_behind
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.study.results import Result
from digs_warp.study.timing import Stopwatch

if TYPE_CHECKING:
    import viser

DRAWING, WATCHING = "drawing", "training"

# Images while the camera moves and at rest [px], and voxels of the points that become splats [m].
SIZES = ((480, 270), (1280, 720))
VOXELS = (0.008, 0.004, 0.002)
SH_DEGREE, FOV_DEG, FRAMES = 3, 45.0, 12

RECORDING = SimulateConfig(frames=24, width=640, height=360, samples_per_pixel=1, tier="law")
STEPS, ROUNDS = 300, 2

ALONE, SERVED, WATCHED = "without --view", "--view, no browser", "--view, a browser looks"
ADDRESS = re.compile(r"http://127\.0\.0\.1:\d+")  # as the command prints it
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
HEADLESS = (
    *("--headless=new", "--no-sandbox", "--no-first-run", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--remote-debugging-port=0"),
)


@dataclass(frozen=True)
class Took:
    """What a command took: wall time and CPU time of all its threads [s]."""

    seconds: float
    cpu_seconds: float


def bench_view() -> list[Result]:
    """Measure both on a recording of the built-in object."""
    with tempfile.TemporaryDirectory() as folder:
        capture = simulate(RECORDING, Path(folder) / "capture")
        starts = [started_from(capture, voxel) for voxel in VOXELS]
        return [*measure_drawing(starts), *measure_training(capture.folder, Path(folder))]


def started_from(capture: Capture, voxel: float) -> Gaussians:
    """Return the Gaussians that a training starts from, as many as the voxels [m] give."""
    init = InitConfig(voxel_size=voxel)
    points = initial_points(capture.frames, init)
    return seed_gaussians(points, SH_DEGREE, init.seed_opacity, init.seed_width)


def measure_drawing(
    scenes: Sequence[Gaussians],
    sizes: Sequence[tuple[int, int]] = SIZES,
    frames: int = FRAMES,
) -> list[Result]:
    """Return the time of a frame by size [px] and number of splats, on all threads; the median of some."""
    import viser

    with redirect_stdout(StringIO()):  # viser prints a table of addresses
        server = viser.ViserServer(host="127.0.0.1", port=FIRST_PORT, verbose=False)
    try:
        return [
            _drawing(gaussians, size, frames, server.scene)
            for gaussians in scenes
            for size in sizes
        ]
    finally:
        with redirect_stdout(StringIO()):
            server.stop()


def _drawing(
    gaussians: Gaussians, size: tuple[int, int], frames: int, scene: "viser.SceneApi"
) -> Result:
    renderer = TrueRenderer(gaussians)
    cameras = orbit(find_subject(gaussians), Intrinsics.from_fov(*size, FOV_DEG), frames)
    renderer.draw(cameras[0], "color")  # loads kernels
    drawing, sending = [], []
    for camera in cameras:
        draw, send = Stopwatch(), Stopwatch()
        with draw:
            drawn = renderer.draw(camera, "color")
        with send:
            put_behind(scene, drawn)
        drawing.append(draw)
        sending.append(send)
    drawn_ms, encoded_ms = (
        1e3 * median(watch.seconds for watch in watches) for watches in (drawing, sending)
    )
    cpu = (a.cpu_seconds + b.cpu_seconds for a, b in zip(drawing, sending, strict=True))
    return Result(
        {"image": f"{size[0]}x{size[1]}", "splats": len(gaussians)},
        {
            **{"drawn [ms]": drawn_ms, "encoded [ms]": encoded_ms},
            **{"frames/s": 1e3 / (drawn_ms + encoded_ms), "CPU [ms]": 1e3 * median(cpu)},
        },
        DRAWING,
    )


def measure_training(
    capture: Path, folder: Path, steps: int = STEPS, rounds: int = ROUNDS
) -> list[Result]:
    """Return what `reconstruct` takes alone, with a page, and with a page that a browser shows.

    Args:
        capture: the recording.
        folder: for results and the browser's profile.
        steps: of the training.
        rounds: of all three in turn, after one that loads kernels; the medians count.
    """
    words = ["reconstruct", str(capture), "--iterations", str(steps), "--overwrite", "--out"]
    words += [str(folder / "result")]
    ways = [ALONE, SERVED] + ([WATCHED] if _browser() else [])
    run(words, ALONE, folder)
    taken: dict[str, list[Took]] = {way: [] for way in ways}
    with progress(rounds * len(ways), "Training", "run") as bar:
        for _ in range(rounds):
            for way, found in taken.items():
                found.append(run(words, way, folder / "profile"))
                bar.update()
    return compare(taken, steps)


def compare(taken: Mapping[str, Sequence[Took]], steps: int) -> list[Result]:
    """Return a row for each way to run a training, held against the training alone."""
    usual = median(each.cpu_seconds for each in taken[ALONE])
    return [_training(way, found, usual, steps) for way, found in taken.items()]


def _training(way: str, taken: Sequence[Took], usual: float, steps: int) -> Result:
    cpu = median(each.cpu_seconds for each in taken)
    return Result(
        {"steps": steps, "reconstruct": way},
        {
            "seconds": median(each.seconds for each in taken),
            "CPU [s]": cpu,
            "more CPU [%]": 100 * (cpu / usual - 1),
        },
        WATCHING,
    )


def run(words: Sequence[str], way: str, profile: Path) -> Took:
    """Run a command of digs-warp in one of the ways; a browser opens the page as soon as it is there.

    Raises:
        DigsError: it failed.
    """
    start = time.perf_counter()
    process = subprocess.Popen(
        _command_line([*words, *([] if way == ALONE else ["--view"])]),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    browser, said = None, []
    try:
        for line in process.stderr:
            said.append(line)
            if way == WATCHED and browser is None and (found := ADDRESS.search(line)):
                browser = _opened(found[0], profile)
        _, status, used = os.wait4(process.pid, 0)
    finally:
        if browser is not None:
            browser.kill()
            browser.wait()
    if status:
        raise DigsError(f"bench view: {way}: {''.join(said).strip()[-500:]}")
    return Took(time.perf_counter() - start, used.ru_utime + used.ru_stime)


def _command_line(words: Sequence[str]) -> list[str]:
    return [sys.executable, "-m", "digs_warp", *words]


def _browser() -> str | None:
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def _opened(address: str, profile: Path) -> "subprocess.Popen[bytes]":
    program = _browser()
    assert program is not None
    flags = [*HEADLESS, f"--user-data-dir={profile}", address]
    return subprocess.Popen([program, *flags], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
