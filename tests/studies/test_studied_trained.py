"""The benchmarks on a trained object, on small scenes: films, meshes, files and viewers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.device.threads import default_threads
from digs_warp.geometry.camera import Intrinsics
from digs_warp.show.film.camera_path import Subject, orbit
from digs_warp.splat.skin import REACH
from digs_warp.train.evaluate import load_test_views
from reference.optional import open3d_or_skip
from reference.tiny_capture import RADIUS, ball, write_tiny_capture
from studies.trained import (
    FORMATS,
    TrainedObject,
    measure_films,
    measure_formats,
    measure_meshes,
    measure_viewers,
)


def test_frame_rates_by_size_and_threads() -> None:
    results = measure_films(ball(), sizes=((64, 36), (32, 18)), frames=3)
    threads = sorted({1, default_threads()})
    assert len(results) == 2 * len(threads)
    for r in results:
        assert abs(r.values["frame rate [1/s]"] * r.values["frame [ms]"] - 1e3) < 1e-6
    assert [r.labels["image"] for r in results[:: len(threads)]] == ["64x36", "32x18"]
    assert all(r.labels["splats"] == 1500 and r.labels["sh_degree"] == 0 for r in results)


def test_distances_by_voxel_size() -> None:
    open3d_or_skip()
    g = ball(4000)
    g.log_scales[:] = np.log(0.006)
    k = Intrinsics.from_fov(96, 96, 40.0)
    cameras = [c for e in (-60, 0, 60) for c in orbit(Subject(np.zeros(3), RADIUS), k, 8, e)]
    # The skins of its splats, 6 mm wide, lie in front of their centers.
    skin = RADIUS + REACH * 0.006
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=skin)
    surface = TriangleMesh(sphere.vertices, sphere.faces, np.ones_like(sphere.vertices))
    results = measure_meshes(TrainedObject(g, cameras, surface), voxels=(0.03, 0.01), near=0.01)
    values = {r.labels["voxel [mm]"]: r.values for r in results}
    assert values[10.0]["triangles"] > 4 * values[30.0]["triangles"]
    assert values[10.0]["Chamfer [mm]"] < 10.0  # a voxel
    assert values[10.0]["F-score at 10 mm"] > 0.9


def test_exact_formats_lose_nothing_and_small_ones_little() -> None:
    g = ball()
    waves = 0.1 * np.sin(g.means @ np.arange(9.0).reshape(3, 3))  # some view dependence
    sh = np.concatenate([g.sh, np.repeat(waves[:, None], 3, axis=1)], axis=1)
    results = measure_formats(replace(g, sh=sh), view_size=(96, 54))
    assert len(results) == len(FORMATS)
    values = {r.labels["format"]: r.values for r in results}
    assert (
        values["npz"]["PSNR [dB]"] == values["PLY"]["PSNR [dB]"] == 100
    )  # dB: equal to the last bit
    assert values["USD"]["PSNR [dB]"] > 80
    assert 32.0 == values[".splat"]["size [B/splat]"] < values["PLY"]["size [B/splat]"]
    assert values["SPZ 3"]["size [B/splat]"] < values["PLY"]["size [B/splat]"] / 4
    for name in ("SPZ 2", "SPZ 3", "SPZ 4", ".splat"):
        assert 25 < values[name]["PSNR [dB]"] < 80
    assert (
        values["SPZ 2"]["size [B/splat]"] < values["SPZ 3"]["size [B/splat]"]
    )  # quaternions of 3 bytes, not 4


def test_viewers_that_dilate_are_farther_from_the_truth(tmp_path: Path) -> None:
    frames = write_tiny_capture(tmp_path, frames=4).frames
    truth = {"1": load_test_views(frames)}
    g = ball()
    surface = TriangleMesh(g.means[:3], np.array([[0, 1, 2]]), np.ones((3, 3)))
    results = measure_viewers(TrainedObject(g, [f.camera for f in frames], surface, truth))
    ours, dilated, antialiased, classic, doubled = (r.values["PSNR at 1 [dB]"] for r in results)
    assert dilated < doubled < classic - 3 < ours - 4  # dB: the capture shows these Gaussians
    assert dilated < antialiased < ours
