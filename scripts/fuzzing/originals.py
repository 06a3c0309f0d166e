"""Healthy inputs of every kind, made by the package itself; small, so that a reader takes milliseconds."""

import json
import shutil
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from digs_warp.cli import main
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import write_image
from digs_warp.formats.splats.files import write_splat_file
from digs_warp.show.film.video import write_video
from fuzzing.recordings import write_euroc, write_seven_scenes

PUBLISHED_STUDY = Path(__file__).resolve().parents[2] / "docs/study/tradeoff/results.jsonl"
RECONSTRUCT = ("--iterations", "4", "--test-every", "3", "--keep-course")


class Originals:
    """The folder of all originals: one folder per kind of input, each made when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def make(self, name: str) -> Path:
        """Return the folder ``name``, one of the methods of this class without its underscore."""
        path = self.folder / name
        if not path.exists():
            getattr(self, f"_{name}")(path)
        return path

    def _scenes(self, folder: Path) -> None:
        """Meshes of all formats, and panoramas."""
        from PIL import Image

        trimesh: Any = import_module("trimesh")

        folder.mkdir()
        rng = np.random.default_rng(0)
        ball = trimesh.creation.icosphere(subdivisions=1)
        ball.visual.vertex_colors = rng.integers(0, 256, (len(ball.vertices), 4), dtype=np.uint8)
        ball.export(folder / "ball.ply")
        (folder / "ball-text.ply").write_bytes(trimesh.exchange.ply.export_ply(ball, "ascii"))
        ball.export(folder / "ball.stl")
        (folder / "ball-text.stl").write_text(trimesh.exchange.stl.export_stl_ascii(ball))
        ball.export(folder / "ball.glb")
        box = trimesh.creation.box()
        picture = Image.fromarray(rng.integers(0, 256, (8, 8, 3), dtype=np.uint8))
        material = trimesh.visual.material.PBRMaterial(
            name="paint", baseColorTexture=picture, metallicFactor=0.1, roughnessFactor=0.6,
            normalTexture=picture, emissiveFactor=[0.1, 0.1, 0.1],
        )  # fmt: skip
        box.visual = trimesh.visual.TextureVisuals(
            uv=rng.random((len(box.vertices), 2)), material=material
        )
        box.export(folder / "box.glb")
        box.export(folder / "box.gltf")
        box.visual.material = trimesh.visual.material.SimpleMaterial(image=picture)
        box.export(folder / "box.obj")
        linear = rng.random((8, 16, 3), dtype=np.float32)
        write_image(folder / "room.exr", linear)
        write_image(folder / "room.png", (255 * linear).astype(np.uint8))
        write_image(folder / "room16.png", (65535 * linear).astype(np.uint16))
        _write_hdr(folder / "room.hdr", linear)

    def _capture(self, folder: Path) -> None:
        scenes = self.make("scenes")
        _digs_warp("simulate", "--mesh", scenes / "ball.ply", "--environment", scenes / "room.png",
                   *("--frames", "4", "--width", "48", "--labels", "all", "--out"), folder)  # fmt: skip

    def _millimetres(self, folder: Path) -> None:
        """A capture with depth as 16-bit PNG."""
        shutil.copytree(self.make("capture"), folder)
        index = folder / "transforms.json"
        for number, frame in enumerate(read_capture(folder).frames):
            depth = np.nan_to_num(frame.load_depth(), nan=0, posinf=0, neginf=0)
            write_image(folder / f"depth/{number:04d}.png", (1000 * depth).astype(np.uint16))
        for path in folder.glob("depth/*.exr"):
            path.unlink()
        content = json.loads(index.read_text())
        for entry in content["frames"]:
            entry["depth_file_path"] = entry["depth_file_path"].replace(".exr", ".png")
        index.write_text(json.dumps(content, indent=2))

    def _reconstruction(self, folder: Path) -> None:
        """A finished one, with its capture beside it: the folder of 'digs-warp run'."""
        shutil.copytree(self.make("capture"), folder / "capture")
        _digs_warp(
            "reconstruct", folder / "capture", "--out", folder / "reconstruction", *RECONSTRUCT
        )

    def _interrupted(self, folder: Path) -> None:
        """A reconstruction with a checkpoint."""
        from digs_warp.train import session
        from digs_warp.train.trainer import Trainer

        shutil.copytree(self.make("capture"), folder / "capture")
        step = Trainer.step

        def cut_off(trainer: Trainer) -> None:
            if trainer.optimizer.step == 2:
                raise KeyboardInterrupt
            step(trainer)

        with (
            patch.object(session, "CHECKPOINT_SECONDS", -1.0),
            patch.object(Trainer, "step", cut_off),
        ):
            _digs_warp("reconstruct", folder / "capture", "--out", folder / "reconstruction", *RECONSTRUCT,
                       ends_with=130)  # fmt: skip

    def _matched(self, folder: Path) -> None:
        """A reconstruction that has its sparse model of structure from motion, and nothing behind it."""
        from fuzzing.sparse_model import write_sparse_model

        shutil.copytree(self.make("reconstruction"), folder)
        write_sparse_model(read_capture(folder / "capture"), folder / "reconstruction" / "sfm")

    def _splats(self, folder: Path) -> None:
        """Gaussians in every format."""
        folder.mkdir()
        self._gaussians().save(folder / "ours.npz")
        for name, version in {
            "v2.spz": 2,
            "v3.spz": 3,
            "v4.spz": 4,
            "a.ply": 3,
            "a.splat": 3,
        }.items():
            write_splat_file(folder / name, self._gaussians(), spz_version=version)
        (folder / "text.ply").write_bytes(_as_text((folder / "a.ply").read_bytes()))
        for name in ("scene.usda", "scene.usdc", "scene.usdz"):
            _digs_warp("convert", folder / "ours.npz", "--out", folder / name)
        _digs_warp("export-usd", self.make("reconstruction") / "reconstruction",
                   "--capture", self.make("capture"), "--out", folder / "capture.usdz")  # fmt: skip

    def _gaussians(self) -> Gaussians:
        rng = np.random.default_rng(0)
        return Gaussians(
            means=rng.normal(size=(8, 3)),
            log_scales=rng.uniform(-6, 0, (8, 3)),
            quats=rng.normal(size=(8, 4)),
            opacity_logits=rng.normal(size=8),
            sh=rng.uniform(-0.9, 0.9, (8, 4, 3)),
        )

    def _tum(self, folder: Path) -> None:
        self._export("tum", folder)

    def _bop(self, folder: Path) -> None:
        self._export("bop", folder)

    def _redwood(self, folder: Path) -> None:
        self._export("redwood", folder)

    def _colmap(self, folder: Path) -> None:
        self._export("colmap", folder)

    def _colmap_text(self, folder: Path) -> None:
        self._export("colmap-text", folder)

    def _7scenes(self, folder: Path) -> None:
        write_seven_scenes(self.make("capture"), folder)

    def _7scenes_info(self, folder: Path) -> None:
        """Another file for the cameras."""
        shutil.copytree(self.make("7scenes"), folder)
        (folder / "camera-intrinsics.txt").unlink()

    def _euroc(self, folder: Path) -> None:
        write_euroc(self.make("capture"), folder)

    def _film(self, folder: Path) -> None:
        folder.mkdir()
        frames = (frame.load_image() for frame in read_capture(self.make("capture")).frames)
        write_video(folder / "walk.mp4", frames, 10)

    def _export(self, form: str, folder: Path) -> None:
        _digs_warp("convert", self.make("capture"), "--to", form, "--out", folder)

    def _nerfstudio(self, folder: Path) -> None:
        shutil.copytree(self.make("millimetres"), folder)
        index = json.loads((folder / "transforms.json").read_text())
        index |= {
            "camera_model": "OPENCV",
            "k1": 0.01,
            "k2": 0.0,
            "p1": 0.0,
            "p2": 0.0,
            "applied_scale": 1.0,
        }
        (folder / "transforms.json").write_text(json.dumps(index))

    def _zed(self, folder: Path) -> None:
        capture, k = self._capture_to_copy(folder)
        for number, frame in enumerate(capture.frames):
            write_image(folder / f"left{number:06d}.png", frame.load_image())
            write_image(folder / f"right{number:06d}.png", frame.load_right_image())
            write_image(folder / f"depth{number:06d}.exr", frame.load_depth())
            np.save(folder / f"depth{number:06d}.npy", frame.load_depth())
        (folder / "calibration.json").write_text(json.dumps(k | {"baseline": 0.12}))

    def _record3d(self, folder: Path) -> None:
        capture, k = self._capture_to_copy(folder)
        for number, frame in enumerate(capture.frames):
            write_image(folder / f"rgb/{number}.png", frame.load_image())
            write_image(folder / f"depth/{number}.exr", frame.load_depth())
        matrix = [k["fx"], 0, 0, 0, k["fy"], 0, k["cx"], k["cy"], 1]
        size = capture.frames[0].camera.intrinsics
        poses = [[0, 0, 0, 1, 0.1 * number, 0, 0] for number in range(len(capture))]
        content = {"K": matrix, "w": size.width, "h": size.height, "fps": 30, "poses": poses}
        (folder / "metadata.json").write_text(json.dumps(content))

    def _scannet(self, folder: Path) -> None:
        capture, k = self._capture_to_copy(folder)
        matrix = f"{k['fx']} 0 {k['cx']} 0\n0 {k['fy']} {k['cy']} 0\n0 0 1 0\n0 0 0 1\n"
        for kind in ("color", "depth"):
            path = folder / f"intrinsic/intrinsic_{kind}.txt"
            path.parent.mkdir(exist_ok=True)
            path.write_text(matrix)
        (folder / "pose").mkdir()
        for number, frame in enumerate(capture.frames):
            write_image(folder / f"color/{number}.png", frame.load_image())
            depth = np.nan_to_num(frame.load_depth(), nan=0, posinf=0, neginf=0)
            write_image(folder / f"depth/{number}.png", (1000 * depth).astype(np.uint16))
            rows = [" ".join(map(str, row)) for row in frame.camera.world_from_cam]
            (folder / f"pose/{number}.txt").write_text("\n".join(rows) + "\n")

    def _capture_to_copy(self, folder: Path) -> tuple[Capture, dict[str, float]]:
        folder.mkdir()
        capture = read_capture(self.make("capture"))
        k = capture.frames[0].camera.intrinsics
        return capture, {"fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy}

    def _settings(self, folder: Path) -> None:
        """Settings of commands, as JSON and YAML, a profile of a camera, and a scene to plan for."""
        import yaml

        folder.mkdir()
        for name in ("ball.ply", "room.png"):
            shutil.copyfile(self.make("scenes") / name, folder / name)
        records = {
            "simulate": self.make("capture") / "run.json",
            "reconstruct": self.make("reconstruction") / "reconstruction" / "run.json",
        }
        for name, path in records.items():
            record = json.loads(path.read_text())
            content = {"command": name, "settings": record["settings"]}
            (folder / f"{name}.yaml").write_text(yaml.safe_dump(content))
            (folder / f"{name}.json").write_text(json.dumps(content))
        figures = {
            "baseline": {"value": 0.1, "origin": "measured", "note": "with a ruler"},
            "max_disparity": {"value": 60.0, "origin": "tuned"},
            "readout_time": {"value": 0.01, "origin": "vendor"},
        }
        profile = {"base": "zed2-720", "title": "My camera", "figures": figures}
        (folder / "camera.yaml").write_text(yaml.safe_dump(profile))

    def _study(self, folder: Path) -> None:
        """Results of a study."""
        folder.mkdir()
        lines = PUBLISHED_STUDY.read_text().splitlines()[:6]
        (folder / "results.jsonl").write_text("\n".join(lines) + "\n")


def _digs_warp(*words: str | Path, ends_with: int = 0) -> None:
    """Run a command line of the package."""
    found = StringIO()
    with redirect_stdout(found), redirect_stderr(found):
        code = main([str(word) for word in words])
    if code != ends_with:
        raise RuntimeError(
            f"digs-warp {' '.join(map(str, words))}: exit code {code}\n{found.getvalue()}"
        )


def _write_hdr(path: Path, linear: np.ndarray) -> None:
    oiio: Any = import_module("OpenImageIO")
    height, width, channels = linear.shape
    target = oiio.ImageOutput.create(str(path))
    target.open(str(path), oiio.ImageSpec(width, height, channels, oiio.FLOAT))
    target.write_image(linear)
    target.close()


def _as_text(ply: bytes) -> bytes:
    """Return a binary PLY file of floats as one with text."""
    header, _, body = ply.partition(b"end_header\n")
    count = next(
        int(line.split()[2]) for line in header.splitlines() if line.startswith(b"element vertex")
    )
    rows: Sequence[Sequence[float]] = np.frombuffer(body, "<f4").reshape(count, -1).tolist()
    text = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in rows)
    header = header.replace(b"binary_little_endian", b"ascii")
    return header + b"end_header\n" + text.encode() + b"\n"
