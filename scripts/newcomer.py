"""Ten tasks of a newcomer: runs the commands of each, and says what they take.

    python scripts/newcomer.py --page     # some minutes; without --page it only prints the rows

CPU seconds of all threads, with compiled kernels: they hardly depend on what else the machine does.
"""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from page_marks import fill

from digs_warp.data.capture import read_capture
from digs_warp.record.files import copy_folder
from digs_warp.show.film.video import write_video
from digs_warp.study.table import Table

DEMO = "digs-warp run --out demo"
TASKS = {
    "see all of it": (DEMO,),
    "record a mesh of mine": ("digs-warp simulate --mesh bottle.glb --out capture",),
    "reconstruct a film": (
        "digs-warp convert walk.mp4 --from video --frames 40 --out film",
        "digs-warp reconstruct film --out from-film --poses sfm --subject scene",
    ),
    "reconstruct an RGB-D recording": (
        "digs-warp convert tum --from tum --out rgbd",
        "digs-warp reconstruct rgbd --out result --masks depth",
    ),
    "reconstruct arrays in Python": ("python examples/06_own_recording.py",),
    "write what others read": tuple(f"digs-warp convert demo --out scene.{s}" for s in ("ply", "spz", "glb")),
    "look at it in the browser": ("digs-warp view demo",),
    "find out what is wrong with a recording": ("digs-warp check rgbd",),
    "test my code at rising noise": (
        "digs-warp simulate --frames 3 --width 160 --out examples/noise_project/recordings/shelf",
        "pytest examples/noise_project",
    ),
    "compare two scenes": (
        "digs-warp edit demo --share 0.5 --out half.usdz",
        "digs-warp view demo half.usdz",
    ),
}  # fmt: skip


def cpu_seconds(command: str, folder: Path) -> float:
    """Run a command line in a folder, `view` for half a minute; return the CPU seconds that it took."""
    program, *words = command.split()
    module = {"digs-warp": ("-m", "digs_warp"), "pytest": ("-m", "pytest", "-q")}.get(program, ())
    before = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    line = [sys.executable, *module, *words]
    if "view" in words:
        line = ["timeout", "--signal=INT", "30", *line, "--no-browser"]
    code = subprocess.run(line, cwd=folder, check=False).returncode
    if code not in (0, 124 if "view" in words else 0):
        raise SystemExit(f"{command}: exit code {code}")
    return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]) - before


def prepare(folder: Path) -> None:
    """Make what other tasks start from."""
    images = (frame.load_image() for frame in read_capture(folder / "demo/capture").frames)
    write_video(folder / "walk.mp4", images, 10)
    for words in ("convert demo/capture --to tum --out tum", "mesh demo --out bottle.glb"):
        cpu_seconds(f"digs-warp {words}", folder)


def main() -> None:
    """Run all tasks; print a row for each."""
    rows, examples = [], Path(__file__).resolve().parents[1] / "examples"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copy_folder(examples, folder / "examples")
        for task, commands in TASKS.items():
            seconds = sum(cpu_seconds(command, folder) for command in commands)
            shown = "<br>".join(f"`{command}`" for command in commands)
            rows.append([task, shown, f"{seconds:.0f}"])
            sys.stdout.write(f"{rows[-1]}\n")
            if DEMO in commands:
                prepare(folder)
    table = Table("tasks", ["task", "commands", "CPU [s]"], rows).markdown()
    if "--page" in sys.argv:
        fill("tutorial.md", "tasks", table)


if __name__ == "__main__":
    main()
