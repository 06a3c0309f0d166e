"""Libraries that are not installed: what does not need them works, what does says which one in a line.

A library is blocked before anything else is imported, in a separate process.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

from reference.mesh_files import save
from reference.noise_capture import write_capture
from reference.tiny_capture import ball

BLOCKED = """
import json, sys
sys.modules.update(dict.fromkeys(sys.argv[1].split(",")))
from digs_warp.cli import main
for words in json.loads(sys.argv[2]):
    print("exit", main(words), file=sys.stderr, flush=True)
"""

DEMO = ["run", "--frames", "3", "--width", "48", "--iterations", "2", "--quiet"]


def without(libraries: str, *commands: list[str]) -> tuple[list[int], str]:
    """Run commands without some modules; return their exit codes and what they wrote to stderr."""
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED, libraries, json.dumps(commands)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lines = done.stderr.splitlines()
    codes = [int(line.split()[1]) for line in lines if line.startswith("exit ")]
    return codes, "\n".join(line for line in lines if not line.startswith("exit "))


@pytest.fixture
def capture(tmp_path: Path) -> str:
    write_capture(tmp_path / "capture", 3)
    return str(tmp_path / "capture")


def test_the_demo_needs_no_library_for_matching_meshes_or_settings(tmp_path: Path) -> None:
    absent = "pycolmap,open3d,pyrender,sklearn,trimesh,zstandard,yaml"
    codes, errors = without(absent, [*DEMO, "--out", str(tmp_path / "demo")])
    assert (codes, errors) == ([0], "")
    assert {"scene.usdz", "report.html"} <= {path.name for path in (tmp_path / "demo").iterdir()}


@pytest.mark.parametrize("flags", [["--poses", "sfm"], ["--strategy", "fusion"]])
def test_without_pycolmap_matching_is_refused_before_any_work(
    flags: list[str], capture: str, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    codes, errors = without(
        "pycolmap",
        [*DEMO, "--out", str(out), *flags],
        ["reconstruct", capture, "--out", str(out), *flags],
    )
    assert codes == [1, 1]
    assert errors.count("pip install pycolmap") == len(errors.splitlines()) == 2
    assert not out.exists()


@pytest.mark.parametrize(
    ("module", "remedy", "command"),
    [
        ("open3d", "open3d", "mesh {splats} --out {out}.ply"),
        ("open3d", "open3d", "reconstruct {capture} --poses rgbd --out {out}"),
        ("trimesh", "trimesh", "simulate --mesh {mesh} --frames 1 --width 32 --out {out}"),
        ("yaml", "pyyaml", "simulate --config {yaml} --out {out}"),
        ("pxr", "usd-core", "usd info {usda}"),
        ("pyrender", "pyrender", "simulate --config {gl} --frames 1 --width 32 --out {out}"),
        (
            "cv2",
            "opencv-python-headless",
            "simulate --tier matcher --frames 1 --width 32 --out {out}",
        ),
        (
            "onnxruntime",
            "'digs-warp[masks]'",
            "reconstruct {capture} --masks isnet --mask-model {usda} --out {out}",
        ),
    ],
)
def test_without_a_library_the_job_that_needs_it_names_it(
    module: str, remedy: str, command: str, capture: str, tmp_path: Path
) -> None:
    splats = tmp_path / "gaussians.npz"
    ball(20).save(splats)
    (tmp_path / "a.usda").write_text("#usda 1.0\n")
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "a.yaml").write_text("settings: {frames: 1}\n")
    places = {"splats": splats, "usda": tmp_path / "a.usda", "mesh": tmp_path / "a.obj"}
    (tmp_path / "gl.json").write_text('{"settings": {"renderer": "gl"}}')
    places |= {"gl": tmp_path / "gl.json"}
    places |= {"yaml": tmp_path / "a.yaml", "out": tmp_path / "out", "capture": Path(capture)}
    words = command.format(**places).split()
    codes, errors = without(
        module, ["--help"], ["info", capture], ["info", str(splats)], ["--quiet", *words]
    )
    assert codes == [0, 0, 0, 1], errors
    assert len(errors.splitlines()) == 1
    assert f"pip install {remedy}" in errors


def test_without_mujoco_a_pile_is_refused_before_any_work(tmp_path: Path) -> None:
    box = save(tmp_path / "box.glb", trimesh.creation.box((0.1, 0.1, 0.1)))
    flags = ["--scene", str(box), str(box), "--arrange", "drop", "--out", str(tmp_path / "out")]
    codes, errors = without("mujoco", ["simulate", *flags])
    assert codes == [1]
    assert "pip install 'digs-warp[drop]'" in errors
    assert not (tmp_path / "out").exists()
