"""Libraries that are not installed: what does not need them works, what does says which one in a line.

They are blocked before anything else is imported, in separate processes: several at once, since a start
takes seconds.
"""

import json
from pathlib import Path

import pytest

from reference.fresh_process import run_fresh
from reference.noise_capture import write_capture
from reference.tiny_capture import ball

BLOCKED = """
import json, sys
sys.modules.update(dict.fromkeys(sys.argv[1].split(",")))
from digs_warp.cli import main
for words in json.loads(sys.argv[2]):
    print("exit", main(words), file=sys.stderr, flush=True)
"""

DEMO = "--quiet run --frames 3 --width 48 --iterations 2 --out {folder}/demo"
SMALL = "simulate --frames 1 --width 32 --out {folder}/out"

# The library to install for each job, or None: it needs none of those that are blocked together.
JOBS = {
    "av,pycolmap,open3d,pyrender,sklearn,trimesh,zstandard": {
        "--help": None,
        "info {folder}/capture": None,
        "info {folder}/gaussians.npz": None,
        DEMO: None,
        "run --out {folder}/refused --frames 3 --poses sfm": "pycolmap",
        "run --out {folder}/refused --frames 3 --strategy fusion": "pycolmap",
        "reconstruct {folder}/capture --out {folder}/refused --poses sfm": "pycolmap",
        "reconstruct {folder}/capture --out {folder}/refused --strategy fusion": "pycolmap",
        "reconstruct {folder}/capture --poses rgbd --out {folder}/out": "open3d",
        "render {folder}/gaussians.npz --width 32 --seconds .1 --out {folder}/a.mp4": "av",
        "mesh {folder}/gaussians.npz --out {folder}/out.ply": "open3d",
        "info {folder}/a.obj": None,
        f"{SMALL} --config {{folder}}/gl.json": "pyrender",
    },
    "pxr,cv2": {
        "--help": None,
        "info {folder}/capture": "opencv-python-headless",
        "info {folder}/gaussians.npz": None,
        "usd validate {folder}/a.usda": "usd-core",
        f"{SMALL} --tier matcher": "opencv-python-headless",
    },
}


@pytest.mark.parametrize("libraries", JOBS)
def test_a_job_without_its_library_names_it_and_others_work(libraries: str, tmp_path: Path) -> None:
    write_capture(tmp_path / "capture", 3)
    ball(20).save(tmp_path / "gaussians.npz")
    (tmp_path / "a.usda").write_text("#usda 1.0\n")
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "gl.json").write_text('{"settings": {"renderer": "gl"}}')
    jobs = {words.format(folder=tmp_path): each for words, each in JOBS[libraries].items()}
    done = run_fresh(BLOCKED, libraries, json.dumps([words.split() for words in jobs]))
    said = [""]
    codes = []
    for line in done.stderr.splitlines():
        if line.startswith("exit "):
            codes.append(int(line.split()[1]))
            said.append("")
        elif line.startswith("digs-warp: "):
            said[-1] += line
    for (words, library), code, error in zip(jobs.items(), codes, said[:-1], strict=True):
        assert code == (0 if library is None else 1), (words, error)
        assert (f"pip install {library}" in error) == (library is not None), (words, error)
        assert error.count("digs-warp: ") <= 1, (words, error)
    assert not (tmp_path / "refused").exists()  # before any work
    if DEMO in JOBS[libraries]:
        made = {path.name for path in (tmp_path / "demo").iterdir()}
        assert {"scene.usdz", "report.html"} <= made
