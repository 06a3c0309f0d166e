"""File names in the folders that the commands write, defined only here, and where noted files are found."""

from collections.abc import Iterator
from pathlib import Path

from digs_warp.checks import DigsError

# In the folder of `digs-warp run`:
CAPTURE = "capture"
RECONSTRUCTION = "reconstruction"
SCENE = "scene.usdz"
SPLATS = "splats.ply"
REPORT = "report.html"
# In every folder that a command wrote:
RUN_RECORD = "run.json"
MANIFEST = "files.jsonl"
# In a folder that a run is writing: its lock, and a new result until it is complete.
LOCK = ".digs-warp.lock"
UNFINISHED = ".digs-warp.unfinished"
# In a capture folder of the simulator (its index: `digs_warp.data.capture`):
SENSOR_PLAN = "sensor_plan.json"
# In the folder of `digs-warp simulate` with many scenes:
DATA_SET = "summary.json"
# In the folder of `digs-warp reconstruct`:
MASKS = "masks"
INITIAL_POINTS = "initial_points.npz"
CHECKPOINT = "checkpoint.npz"
TRAINING = "training.jsonl"
COURSE = "course"
GAUSSIANS = "gaussians.npz"
TRAINED_POSES = "trained_poses.npz"
EVALUATION = "evaluation.json"


def find_gaussians(source: Path) -> Path:
    """Return the Gaussians file of a reconstruction or `run` folder, or ``source`` if it is a file."""
    if not source.is_dir():
        return source
    for folder in (source, source / RECONSTRUCTION):
        if (folder / GAUSSIANS).is_file():
            return folder / GAUSSIANS
    raise DigsError(
        f"'{source}': no {GAUSSIANS} in it; name a folder that 'digs-warp reconstruct' has finished"
    )


def places_of(noted: Path, folder: Path) -> Iterator[Path]:
    """Yield where a file may be that the run in a folder noted, the likeliest place first.

    A relative path is relative to the folder in which the command was started. That is mostly one above its
    results, and need not be the one of today.

    Args:
        noted: the path in the record.
        folder: the results.
    """
    if not noted.is_absolute():
        for above in (*folder.parents, *folder.absolute().parents):
            yield above / noted
    yield noted
