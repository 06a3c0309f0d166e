"""Healthy inputs of every kind, made by the package itself; small, so that a reader takes milliseconds."""

import gzip
import json
import re
import shutil
import struct
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from digs_warp.cli import main
from digs_warp.data.capture import read_capture
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import write_image
from digs_warp.formats.splats.files import write_splat_file
from fuzzing.recordings import WRITERS, millimetres

RECONSTRUCT = ("--iterations", "4", "--test-every", "3", "--keep-course")

# Folders that `digs-warp convert --to` writes.
EXPORTED = ("tum", "bop", "redwood", "colmap", "colmap_text")


class Originals:
    """The folder of all originals: one folder per kind of input, each made when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def make(self, name: str) -> Path:
        """Return a folder: of `EXPORTED`, `WRITERS`, or a method of this class without its underscore."""
        path = self.folder / name
        if path.exists():
            return path
        if name in EXPORTED:
            form = name.replace("_", "-")
            _digs_warp("convert", self.make("capture"), "--to", form, "--out", path)
        elif name in WRITERS:
            path.mkdir()
            WRITERS[name](read_capture(self.make("capture")).frames, path)
        else:
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
        for suffix in ("ply", "stl", "glb"):
            ball.export(folder / f"ball.{suffix}")
        (folder / "ball-text.ply").write_bytes(trimesh.exchange.ply.export_ply(ball, "ascii"))
        (folder / "ball-text.stl").write_text(trimesh.exchange.stl.export_stl_ascii(ball))
        box = trimesh.creation.box()
        picture = Image.fromarray(rng.integers(0, 256, (8, 8, 3), dtype=np.uint8))
        material = trimesh.visual.material.PBRMaterial(
            name="paint", baseColorTexture=picture, metallicFactor=0.1, roughnessFactor=0.6,
            normalTexture=picture, emissiveFactor=[0.1, 0.1, 0.1],
        )  # fmt: skip
        uv = rng.random((len(box.vertices), 2))
        box.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
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
                   *("--profile", "bare-matcher", "--frames", "4", "--width", "48"),
                   *("--labels", "all", "--out"), folder)  # fmt: skip

    def _millimetres(self, folder: Path) -> None:
        """A capture with depth as 16-bit PNG."""
        shutil.copytree(self.make("capture"), folder)
        for number, frame in enumerate(read_capture(folder).frames):
            write_image(folder / f"depth/{number:04d}.png", millimetres(frame))
        for path in folder.glob("depth/*.exr"):
            path.unlink()
        depth = re.compile(r'("depth_file_path": "[^"]*)\.exr')
        _edit_index(folder, lambda text: depth.sub(r"\1.png", text))

    def _nerfstudio(self, folder: Path) -> None:
        """The same with lenses."""
        shutil.copytree(self.make("millimetres"), folder)
        lens = '"camera_model": "OPENCV", "k1": 0.01, "k2": 0.0, "p1": 0.0, "p2": 0.0'
        _edit_index(folder, lambda text: text.replace("{", f'{{{lens}, "applied_scale": 1.0,', 1))

    def _reconstruction(self, folder: Path, ends_with: int = 0) -> None:
        """A finished one, with its capture beside it: the folder of 'digs-warp run'."""
        shutil.copytree(self.make("capture"), folder / "capture")
        words = ("reconstruct", folder / "capture", "--out", folder / "reconstruction")
        _digs_warp(*words, *RECONSTRUCT, ends_with=ends_with)

    def _interrupted(self, folder: Path) -> None:
        """A reconstruction with a checkpoint."""
        from digs_warp.train import session
        from digs_warp.train.trainer import Trainer

        step = Trainer.step

        def cut_off(trainer: Trainer) -> None:
            if trainer.optimizer.step == 2:
                raise KeyboardInterrupt
            step(trainer)

        at_once = patch.object(session, "CHECKPOINT_SECONDS", -1.0)
        with at_once, patch.object(Trainer, "step", cut_off):
            self._reconstruction(folder, ends_with=130)

    def _splats(self, folder: Path) -> None:
        """Gaussians in every format."""
        folder.mkdir()
        rng = np.random.default_rng(0)
        gaussians = Gaussians(
            means=rng.normal(size=(8, 3)),
            log_scales=rng.uniform(-6, 0, (8, 3)),
            quats=rng.normal(size=(8, 4)),
            opacity_logits=rng.normal(size=8),
            sh=rng.uniform(-0.9, 0.9, (8, 4, 3)),
        )
        gaussians.save(folder / "ours.npz")
        for name in ("a.ply", "a.splat", "a.compressed.ply", "a.sog", "a.glb"):
            write_splat_file(folder / name, gaussians)
        write_splat_file(folder / "v3.spz", gaussians)
        (folder / "v4.spz").write_bytes(spz_4((folder / "v3.spz").read_bytes(), 8, 1))
        (folder / "text.ply").write_bytes(_as_text((folder / "a.ply").read_bytes()))
        for name in ("scene.usda", "scene.usdc", "scene.usdz"):
            _digs_warp("convert", folder / "ours.npz", "--out", folder / name)
        _digs_warp("export-usd", self.make("reconstruction") / "reconstruction",
                   "--capture", self.make("capture"), "--out", folder / "capture.usdz")  # fmt: skip

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
            content = {"command": name, "settings": json.loads(path.read_text())["settings"]}
            (folder / f"{name}.yaml").write_text(yaml.safe_dump(content))
            (folder / f"{name}.json").write_text(json.dumps(content))
        figures = {
            "baseline": {"value": 0.1, "origin": "measured", "note": "with a ruler"},
            "max_disparity": {"value": 60.0, "origin": "tuned"},
            "readout_time": {"value": 0.01, "origin": "vendor"},
        }
        profile = {"base": "zed2-720", "title": "My camera", "figures": figures}
        (folder / "camera.yaml").write_text(yaml.safe_dump(profile))


def _digs_warp(*words: str | Path, ends_with: int = 0) -> None:
    """Run a command line of the package."""
    found, line = StringIO(), [str(word) for word in words]
    with redirect_stdout(found), redirect_stderr(found):
        code = main(line)
    if code != ends_with:
        raise RuntimeError(f"digs-warp {' '.join(line)}: exit code {code}\n{found.getvalue()}")


def _edit_index(folder: Path, change: Callable[[str], str]) -> None:
    index = folder / "transforms.json"
    index.write_text(json.dumps(json.loads(change(index.read_text())), indent=2))


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
    columns = header.count(b"property")
    rows: Sequence[Sequence[float]] = np.frombuffer(body, "<f4").reshape(-1, columns).tolist()
    text = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in rows)
    header = header.replace(b"binary_little_endian", b"ascii")
    return header + b"end_header\n" + text.encode() + b"\n"


def spz_4(version_3: bytes, count: int, degree: int) -> bytes:
    """The same Gaussians in the container of version 4, which others write."""
    import zstandard

    data = gzip.decompress(version_3)
    frames, at = [], 16
    sizes = [count * each for each in (9, 1, 3, 3, 4, 3 * ((degree + 1) ** 2 - 1)) if each]
    for size in sizes:
        frames.append(zstandard.ZstdCompressor().compress(data[at : at + size]))
        at += size
    table = [struct.pack("<QQ", len(f), size) for f, size in zip(frames, sizes, strict=True)]
    head = (
        data[:4]
        + struct.pack("<I", 4)
        + data[8:15]
        + bytes([len(frames)])
        + struct.pack("<I12x", 32)
    )
    return b"".join([head, *table, *frames])
