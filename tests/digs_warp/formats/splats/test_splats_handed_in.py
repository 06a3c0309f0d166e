"""Splat files as people hand them in: far from the origin, with activated values, rows of zeros, flags."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.cli import main
from digs_warp.data.capture import read_capture
from digs_warp.data.gaussians import ANTIALIASED, FIELDS, Gaussians
from digs_warp.data.ply_table import read_ply_header, read_table, write_tables
from digs_warp.formats.splats.files import write_splat_file
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.records import Poses
from digs_warp.pipeline.scene_files import read_scene, write_scene_file
from reference.splat_scenes import random_gaussians

UTM = np.array([431000.0, 4582000.0, 312.0])
FORMATS = [".ply", ".spz", ".splat", ".npz", ".usda", ".usdz"]


def scene(count: int = 300) -> Gaussians:
    """A field of 4 m of splats of a few centimetres."""
    rng = np.random.default_rng(count)
    return replace(
        random_gaussians(count, 1),
        means=rng.uniform(-2, 2, (count, 3)),
        log_scales=np.log(rng.uniform(0.01, 0.05, (count, 3))),
        opacity_logits=rng.normal(0, 3, count),
        screen_filter=ANTIALIASED,
    )


def centers(path: Path) -> np.ndarray:
    """In the frame of the file, float64."""
    table = read_table(path, read_ply_header(path), "vertex")
    return np.stack([table[axis].astype(np.float64) for axis in "xyz"], axis=1)


@pytest.mark.parametrize(("kind", "up"), [("f8", "z"), ("f4", "y")])
def test_a_scene_at_survey_coordinates_keeps_its_places(
    tmp_path: Path, kind: str, up: str, capsys: pytest.CaptureFixture[str]
) -> None:
    near = scene()
    path = tmp_path / "utm.ply"
    write_splat_file(path, near)
    table = read_table(path, read_ply_header(path), "vertex")
    places = (near.means.astype(np.float64) + UTM).astype(kind)
    far = table.astype([(n, kind if n in "xyz" else "f4") for n in table.dtype.names or ()])
    for axis, name in enumerate("xyz"):
        far[name] = places[:, axis]
    write_tables(path, {"vertex": far}, [])
    for suffix in FORMATS:
        out = tmp_path / f"out{suffix}"
        assert main(["convert", str(path), "--out", str(out), "--up", up]) == 0
        kept = suffix not in (".spz", ".splat")
        assert ("cannot hold places so far" in capsys.readouterr().err) != kept
        again = tmp_path / f"again{suffix}.ply"
        assert main(["convert", str(out), "--out", str(again), "--up", up]) == 0
        found = centers(again)
        loaded = read_scene(out).gaussians
        assert np.abs(loaded.means).max() < 4 and (loaded.world_offset is not None) == kept
        if not kept:
            found = found + np.round(np.median(places, axis=0))
        np.testing.assert_allclose(found, places, atol=1e-5, rtol=0)


def spoilt(which: str) -> Gaussians:
    good = scene()
    if which == "zeros":
        good = replace(good, **{name: getattr(good, name).copy() for name in FIELDS})
        for name in FIELDS:
            getattr(good, name)[:100] = 0
    changes = {
        "scales": {"log_scales": good.scales},
        "opacities": {"opacity_logits": good.opacities},
        "colors": {"sh": np.full_like(good.sh, 128.0)},
    }
    return replace(good, **changes.get(which, {}))


@pytest.mark.parametrize(
    ("which", "said"),
    [
        ("good", ""),
        ("scales", "taken for logarithms"),
        ("opacities", "taken for logits"),
        ("zeros", "100 of 300 lie at one point (0, 0, 0)"),
        ("colors", "brightness of 36.6"),
    ],
)
def test_implausible_values_are_named(
    tmp_path: Path, which: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for suffix in (".ply", ".npz"):
        path = tmp_path / f"a{suffix}"
        spoilt(which).save(path)
        assert main(["info", str(path)]) == 0
        out = capsys.readouterr().out
        assert said in out and ("doubtful" in out) == bool(said)
        usd = tmp_path / f"{path.stem}{suffix}.usda"
        assert main(["convert", str(path), "--out", str(usd)]) == 0
        assert said in capsys.readouterr().err
        assert main(["usd", "validate", str(usd)]) == 0
        assert said in capsys.readouterr().out


def test_a_reconstruction_far_away_is_written_where_it_is(tmp_path: Path) -> None:
    made = Reconstruction(gaussians=scene(), poses=Poses(world_offset=(431000.0, 4582000.0, 312.0)))
    write_scene_file(tmp_path / "a.ply", made, tmp_path)
    np.testing.assert_allclose(centers(tmp_path / "a.ply"), scene().means + UTM, atol=1e-6, rtol=0)
    assert made.scene_metadata["world_offset"] == UTM.tolist()


def test_splats_far_away_are_seen_by_the_cameras_of_their_recording(
    tmp_path: Path, capture_folder: Path
) -> None:
    """The recording has another offset than whole metres near the middle of the splats."""
    capture = read_capture(capture_folder)
    offset = (430000.5, 4581000.25, 300.0)
    capture = replace(capture, about=replace(capture.about, world_offset=offset))
    near = scene()
    write_splat_file(tmp_path / "a.ply", replace(near, world_offset=offset))
    result = read_scene(tmp_path / "a.ply", capture=capture)
    np.testing.assert_allclose(result.gaussians.means, near.means, atol=1e-6)
    assert result.gaussians.world_offset == offset


def rewritten(path: Path, change: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]) -> Path:
    """Write the columns of a PLY file again, changed; doubles stay doubles."""
    table = read_table(path, read_ply_header(path), "vertex")
    columns = change({name: table[name] for name in table.dtype.names or ()})
    kinds = [(name, values.dtype.str) for name, values in columns.items()]
    again = np.empty(len(table), kinds)
    for name, values in columns.items():
        again[name] = values
    write_tables(path, {"vertex": again, "delta_vertex_1": again[:1]})
    return path


def with_degree_four(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    rest = [columns.pop(f"f_rest_{i}") for i in range(9)]
    bands = [column for i in range(3) for column in (*rest[3 * i : 3 * i + 3], *[rest[0]] * 21)]
    return columns | {f"f_rest_{i}": column for i, column in enumerate(bands)}


def test_what_other_trainers_add_or_leave_out(tmp_path: Path, caplog) -> None:
    good = scene()
    write_splat_file(tmp_path / "a.ply", good)
    found = read_scene(rewritten(tmp_path / "a.ply", with_degree_four)).gaussians
    assert found.sh_degree == 3
    np.testing.assert_array_equal(found.sh[:, :4], good.sh)
    assert "colors above degree 3 are left out" in caplog.text
    assert "not read: delta_vertex_1" in caplog.text
    write_splat_file(tmp_path / "b.ply", good)
    flat = rewritten(tmp_path / "b.ply", lambda c: {k: v for k, v in c.items() if k != "scale_2"})
    found = read_scene(flat).gaussians
    np.testing.assert_array_equal(found.log_scales[:, :2], good.log_scales[:, :2])
    assert found.scales[:, 2].max() < 1e-11
    assert "flat splats, without scale_2" in caplog.text


def test_what_floats_far_away_have_lost_is_said(tmp_path: Path, caplog) -> None:
    for kind, said in (("<f8", False), ("<f4", True)):
        write_splat_file(tmp_path / "a.ply", scene())
        moved = {axis: UTM[i] for i, axis in enumerate("xyz")}
        change = lambda c: c | {a: (c[a] + v).astype(kind) for a, v in moved.items()}  # noqa: B023, E731
        caplog.clear()
        read_scene(rewritten(tmp_path / "a.ply", change))
        assert ("It has them in steps of 0.5 m: export it" in caplog.text) == said


def test_files_of_splats_that_are_not_read_name_the_cure(tmp_path: Path, capsys) -> None:
    for suffix in (".ksplat", ".lcc"):
        (tmp_path / f"a{suffix}").write_bytes(b"1")
        assert main(["info", str(tmp_path / f"a{suffix}")]) == 1
        assert "SuperSplat and splat-transform make PLY" in capsys.readouterr().err
