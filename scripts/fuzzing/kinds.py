"""The kinds of inputs: which files are damaged, and the command lines that read them."""

from fuzzing.inputs import Input, Kind
from fuzzing.originals import RECONSTRUCT

SIMULATE = "simulate --mesh {mesh} --environment {room} --frames 1 --width 32 --out OUT"
PLAN = "plan --profile camera.yaml --mesh ball.ply --environment room.png --frames 1 --width 32"
TRAIN = " ".join(("--out OUT", *RECONSTRUCT))
RESUME = " ".join(("reconstruct capture --out reconstruction --resume", *RECONSTRUCT))


def _scene(name: str, *beside: str, damaged: str | None = None) -> Input:
    lines = (f"info {name}", SIMULATE.format(mesh=name, room="room.png"))
    return Input("scenes", damaged or name, lines, (name, "room.png", *beside))


def _room(name: str) -> Input:
    line = SIMULATE.format(mesh="ball.ply", room=name)
    return Input("scenes", name, (line,), (name, "ball.ply"))


def _capture(folder: str, damaged: str) -> Input:
    lines = ("info .", f"reconstruct . {TRAIN}", "convert . --to bop --out OUT")
    return Input(folder, damaged, lines)


def _recording(folder: str, *damaged: str, form: str | None = None) -> tuple[Input, ...]:
    line = f"convert . --from {form or folder} --out OUT"
    return tuple(Input(folder, name, (line,)) for name in damaged)


def _splats(*names: str, words: tuple[str, ...] = ("info",)) -> tuple[Input, ...]:
    return tuple(
        Input("splats", name, (*(f"{each} {name}" for each in (*words, "convert --out OUT.npz")),), (name,))
        for name in names
    )  # fmt: skip


def _usd(*names: str) -> tuple[Input, ...]:
    return _splats(*names, words=("info", "usd validate"))


def _result(name: str) -> Input:
    lines = (
        *("info .", "info reconstruction"),
        "export-usd reconstruction --capture capture --out OUT.usdz",
        RESUME,
    )
    return Input("reconstruction", name, lines)


def _settings(command: str, *words: str) -> tuple[Input, ...]:
    """The settings are only read: extreme ones are legal, and would run for years."""
    files = [f"{command}.{suffix}" for suffix in ("yaml", "json")]
    line = " ".join((command, *words, "--config"))
    return tuple(Input("settings", file, (f"{line} {file} --help",)) for file in files)


LAYERS = [f"{name}/0001.png" for name in ("images", "right", "masks", "confidence", "cause")]

KINDS = (
    Kind("mesh: GLB, glTF", (
        _scene("ball.glb"), _scene("box.glb"),
        _scene("box.gltf", "gltf_buffer_*.bin"),
    )),
    Kind("mesh: OBJ, MTL", (
        _scene("box.obj", "material.mtl", "material_0.png"),
        _scene("box.obj", "material.mtl", "material_0.png", damaged="material.mtl"),
        _scene("box.obj", "material.mtl", "material_0.png", damaged="material_0.png"),
    )),
    Kind("mesh: PLY, STL", tuple(map(_scene, ("ball.ply", "ball-text.ply", "ball.stl", "ball-text.stl")))),
    Kind("environment: HDR, EXR, PNG", tuple(map(_room, ("room.hdr", "room.exr", "room.png", "room16.png")))),
    Kind("capture: transforms.json", (
        _capture("capture", "transforms.json"), _capture("millimetres", "transforms.json"),
    )),
    Kind("capture: images, depth, masks", (
        *(_capture("capture", layer) for layer in (*LAYERS, "depth/0001.exr", "depth/0002.exr")),
        _capture("millimetres", "depth/0001.png"),
    )),
    Kind("recording: JSON indices", (
        *_recording("nerfstudio", "transforms.json"), *_recording("zed", "calibration.json"),
        *_recording("record3d", "metadata.json"), *_recording("redwood", "camera_intrinsic.json"),
        *_recording("bop", "train/000000/scene_camera.json", "train/000000/scene_gt.json"),
    )),
    Kind("recording: lists, poses, depth", (
        *_recording("tum", "rgb.txt", "depth.txt", "groundtruth.txt", "calibration.txt"),
        *_recording("redwood", "trajectory.log"),
        *_recording("scannet", "pose/1.txt", "intrinsic/intrinsic_color.txt"),
        *_recording("scannet", "intrinsic/intrinsic_depth.txt"),
        *_recording("zed", "depth000001.npy", "depth000001.exr"),
    )),
    Kind("recording: COLMAP, 7-Scenes", (
        *_recording("colmap", *(f"sparse/0/{name}.bin" for name in ("cameras", "images", "points3D"))),
        *_recording("colmap_text", *(f"sparse/0/{name}.txt" for name in ("cameras", "images", "points3D")),
                    form="colmap"),
        *_recording("7scenes", "frame-000001.pose.txt", "frame-000001.depth.png", "camera-intrinsics.txt"),
    )),
    Kind("splats: PLY", _splats("a.ply", "text.ply", "a.compressed.ply")),
    Kind("splats: SOG", _splats("a.sog")),
    Kind("splats: glTF", _splats("a.glb")),
    Kind("splats: SPZ", _splats("v3.spz", "v4.spz")),
    Kind("splats: .splat, .npz", _splats("a.splat", "ours.npz")),
    Kind("scene: usda", _usd("scene.usda")),
    Kind("scene: usdc", _usd("scene.usdc")),
    Kind("scene: usdz", _usd("scene.usdz", "capture.usdz")),
    Kind("results: run, training, evaluation", tuple(
        _result(f"reconstruction/{name}")
        for name in ("run.json", "training.jsonl", "evaluation.json", "cameras.json")
    )),
    Kind("results: checkpoint, points", (
        *(
            Input("interrupted", f"reconstruction/{name}", (RESUME,))
            for name in ("checkpoint.npz", "initial_points.npz")
        ),
        *map(_result, ("reconstruction/initial_points.npz", "reconstruction/gaussians.npz")),
    )),
    Kind("settings, profiles", (
        *_settings("simulate", "--out", "x"), *_settings("reconstruct", "x", "--out", "x"),
        Input("settings", "camera.yaml", (PLAN,)),
    )),
)  # fmt: skip


def find_kinds(names: list[str]) -> tuple[Kind, ...]:
    """Return the kinds whose names contain one of ``names``; all without any.

    Raises:
        ValueError: a name that fits none.
    """
    known = "; ".join(kind.name for kind in KINDS)
    for name in names:
        if not any(name in kind.name for kind in KINDS):
            raise ValueError(f"--kind {name}: expected a part of one of: {known}")
    return tuple(kind for kind in KINDS if not names or any(name in kind.name for name in names))
