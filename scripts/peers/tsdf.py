"""Fuse the depth of real recordings with Open3D (TSDF) and draw the mesh where photographs were held out.

    python -m scripts.peers.tsdf hololens_room_sequence tum_cabinet_orbit --page

Beside it: reconstructions of the same frames with the recorded poses, after some numbers of steps. All are
compared over the pixels that the mesh covers. With --page the table also goes into docs/recordings.md.
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.frame import Frame
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.device.libraries import import_open3d
from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.init.config import InitConfig
from digs_warp.pipeline.reconstruct import ReconstructConfig, reconstruct
from digs_warp.poses.from_images.config import SfmConfig
from digs_warp.splat.device import DeviceGaussians
from digs_warp.study.scenes import sample_data
from digs_warp.surface import fuse
from digs_warp.surface.depth_views import DepthView
from digs_warp.train.config import Stop, TrainConfig
from digs_warp.train.evaluate import Rendering, load_test_views, render_views, score_view
from scripts.page_marks import fill
from studies.real_recordings import convert, find_recordings
from studies.results import Result, format_tables, tables
from studies.timing import Stopwatch

VOXEL = 0.02  # [m]; with finer ones the mesh is noisier, and covers less
STEPS = (20, 100, 500)
RADIUS = 8.0  # [m] around the first camera; depth beyond is left out


def compared(name: str) -> list[Result]:
    """Return a row for each voxel size and for each number of steps."""
    (recording,) = find_recordings(sample_data(), [name])
    with tempfile.TemporaryDirectory() as folder:
        capture = convert(recording, sample_data() / "rgbd" / name, Path(folder) / "capture")
        training, held_out = capture.split()
        ways: dict[str, tuple[list[Rendering], float, int]] = {}
        with Stopwatch() as watch:
            mesh = fused(training)
        seen = [draw(mesh, frame.camera) for frame in held_out]
        ways["TSDF"] = seen, watch.cpu_seconds, len(mesh)
        for steps in STEPS:
            ways[f"{steps} steps"] = reconstructed(
                capture, held_out, steps, Path(folder) / f"{steps}"
            )
        covered = [each.coverage > 0 for each in ways["TSDF"][0]]
        rows = []
        for way, (seen, cpu, count) in ways.items():
            values = _scores(seen, covered, held_out)
            values |= {"CPU [s]": cpu, "triangles or Gaussians": count}
            rows.append(Result({"recording": name, "by": way}, values))
        return rows


def fused(frames: Sequence[Frame]) -> TriangleMesh:
    """Return the mesh of the recorded depth, also where a single frame saw it."""
    views = (
        DepthView(f.camera, f.load_image().astype(np.float32) / 255, np.nan_to_num(f.load_depth()))
        for f in frames
    )
    with patch.object(fuse, "LEAST_VIEWS", 1.0):
        return fuse.fuse_views(views, VOXEL, frames[0].camera.center_world, RADIUS)


def draw(mesh: TriangleMesh, camera: Camera) -> Rendering:
    """Cast a ray through the middle of each pixel; colors are interpolated between vertices."""
    open3d, k = import_open3d(), camera.intrinsics
    scene = open3d.t.geometry.RaycastingScene()  # pyright: ignore[reportAttributeAccessIssue]
    scene.add_triangles(mesh.points_world.astype(np.float32), mesh.triangles.astype(np.uint32))
    ends = camera.unproject(pixel_centers(k.width, k.height), np.ones((k.height, k.width)))
    rays = np.concatenate(
        [np.broadcast_to(camera.center_world, ends.shape), ends - camera.center_world], -1
    )
    hit = scene.cast_rays(open3d.core.Tensor(rays.astype(np.float32)))
    found = np.isfinite(hit["t_hit"].numpy())
    corners = mesh.triangles[hit["primitive_ids"].numpy()[found]]
    b, c = hit["primitive_uvs"].numpy()[found].T
    weights = np.stack([1 - b - c, b, c], axis=1)[..., None]
    image = np.ones((k.height, k.width, 3), np.float32)
    image[found] = (mesh.colors[corners] * weights).sum(axis=1)
    return Rendering(image, found.astype(np.float32))


def reconstructed(
    capture: Capture, held_out: Sequence[Frame], steps: int, folder: Path
) -> tuple[list[Rendering], float, int]:
    """Return what a reconstruction shows in the held-out views, its CPU seconds, and its size."""
    train = TrainConfig(stop=Stop(iterations=steps))
    # So that the held-out cameras are the recorded ones for both.
    sfm, init = SfmConfig(poses="capture", refine_poses="off"), InitConfig(strategy="highdepth")
    config = ReconstructConfig(sfm=sfm, init=init, train=train)
    with Stopwatch() as watch:
        result = reconstruct(capture, config, folder)
    gaussians = DeviceGaussians.from_numpy(result.gaussians, "cpu")
    seen = render_views(gaussians, load_test_views(held_out))
    return seen, watch.cpu_seconds, len(result.gaussians)


def _scores(
    seen: Sequence[Rendering], covered: Sequence[np.ndarray], frames: Sequence[Frame]
) -> dict[str, float]:
    """Return mean scores over the pixels that the mesh covers."""
    found = []
    for rendering, inside, view in zip(seen, covered, load_test_views(frames), strict=True):
        there = replace(view, object_pixels=inside, share=view.share * inside)
        score = score_view(rendering, there)
        found.append((score.psnr_object, score.psnr_object_aligned, 100 * float(inside.mean())))
    psnr, aligned, share = np.mean(found, axis=0).tolist()
    return {"covered [%]": share, "PSNR there [dB]": psnr, "exposure fitted [dB]": aligned}


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="+", help="names of real recordings with depth")
    parser.add_argument("--page", action="store_true", help="also write docs/recordings.md")
    given = parser.parse_args()
    results = [row for name in given.recordings for row in compared(name)]
    sys.stdout.write(format_tables(results) + "\n")
    if given.page:
        (table,) = tables(results)
        fill("recordings.md", "tsdf", table.markdown())


if __name__ == "__main__":
    main()
