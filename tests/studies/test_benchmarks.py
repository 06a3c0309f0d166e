"""Benchmarks: each runs small and measures what it says; tables and lines for programs tell the same."""

import importlib
import json
import re
import time
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.data.images import encode_jpeg
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.formats.captures.formats import export_capture, read_recording
from digs_warp.record.run_log import RunLog
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate
from digs_warp.train.evaluate import load_test_views
from reference.optional import open3d_or_skip
from reference.tiny_capture import ball, write_tiny_capture
from scripts.page_marks import DOCS
from studies import recordings
from studies.benchmarks import BENCHMARKS, Benchmark, find_benchmark
from studies.budget import recorded_cpu, stage_times
from studies.growth import MEMORY, results
from studies.pages import PAGES
from studies.real_recordings import DOOR_REDUCTION, RECORDINGS, RealRecording, smaller_door
from studies.realism import bench_realism
from studies.results import Result, format_number, format_tables, tables, write_json_lines
from studies.simulator import COLUMNS, TIERS, TIME, bench_sim
from studies.surface import FUSED, MILLIMETERS, RATIO, Scope, bench_surface, with_medians
from studies.trained import FORMATS, TrainedObject, measure_formats, measure_viewers

RESULTS = [
    Result({"splats": 1000, "stage": "forward"}, {"time [ms]": 12.345678, "passes": 3}),
    Result({"splats": 1000, "stage": "backward"}, {"time [ms]": 1234.5}),
]


def test_json_lines_hold_exactly_the_results(tmp_path: Path) -> None:
    write_json_lines(RESULTS, tmp_path / "results.jsonl")
    lines = (tmp_path / "results.jsonl").read_text().splitlines()
    assert [Result(**json.loads(line)) for line in lines] == RESULTS


def test_the_table_names_shared_settings_once_and_aligns_its_columns() -> None:
    lines = format_tables(RESULTS).splitlines()
    assert lines[0] == "splats: 1000"
    header, rule, *rows = lines[2:]
    assert header.split() == ["stage", "time", "[ms]", "passes"]
    assert set(rule) == {"-", " "}
    assert [row.split() for row in rows] == [["forward", "12.35", "3"], ["backward", "1,234"]]
    assert rows[0].index("12.35") + 5 == rows[1].index("1,234") + 5


def test_no_results_make_no_table() -> None:
    assert format_tables([]) == "no results"


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.12345, "0.123"), (1.23456, "1.235"), (99.999, "100.00"), (123456.0, "123,456")]
    + [(12, "12"), (7_500_000, "7,500,000")],
)
def test_numbers_keep_about_four_digits(value: float, text: str) -> None:
    assert format_number(value) == text


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda benchmark: benchmark.name)
def test_every_benchmark_names_functions_and_pages_that_exist(benchmark: Benchmark) -> None:
    names = benchmark.functions
    for module, _, name in (each.rpartition(".") for each in names):
        assert callable(getattr(importlib.import_module(f"studies.{module}"), name))
    for page in benchmark.pages:
        assert f"<!-- {benchmark.name}" in (DOCS / page).read_text(encoding="utf-8")


def test_every_mark_of_a_page_is_filled_by_something_that_exists() -> None:
    known = {(page, each.name) for each in BENCHMARKS for page in each.pages}
    for page in DOCS.rglob("*.md"):
        for mark, writer in re.findall(r"<!-- ([^:>]+): written by (.+?) -->", page.read_text()):
            if writer.startswith("scripts/"):
                assert (DOCS.parent / writer).is_file(), (page, writer)
                continue
            name = writer.removeprefix("python -m studies page ")
            assert name in PAGES or (str(page.relative_to(DOCS)), name) in known, (page, mark)
            assert name in PAGES or mark == "machine" or mark.split()[0] == name, (page, mark)


def test_an_unknown_benchmark_or_case_is_named() -> None:
    with pytest.raises(DigsError, match="did you mean 'raster'"):
        find_benchmark("rastr")
    with pytest.raises(DigsError, match="no case 'mug'; it has ycb_mustard_bottle"):
        find_benchmark("surface").run(["mug"])


def test_make_pages_writes_all_pages() -> None:
    recipe = (DOCS.parent / "Makefile").read_text(encoding="utf-8")
    recipe = recipe.split("\npages:")[1].split("studies page ")[1].split("\n\n")[0]
    every = {each.name for each in BENCHMARKS} | set(PAGES)
    assert {*recipe.replace("\\", "").split()} == every - {"studies"}


LAYOUTS = {"hololens_room_sequence": 24, "tum_cabinet_orbit": 29}


def test_growth_is_the_exponent_between_the_two_largest_sizes() -> None:
    costs = [{"train": 9.0}, {"train": 0.5, "x": 1.0}, {"train": 8.0, "x": 2.0, MEMORY: 700.0}]
    train, memory = results("t", ["1", "10", "40"], [1, 10, 40], costs)
    assert train.labels == {"stage": "train [CPU s]"} and memory.labels == {"stage": MEMORY}
    assert train.values == {"1": 9.0, "10": 0.5, "40": 8.0, "exponent": 2.0}


def test_the_budget_is_timed_by_both_clocks_and_read_from_its_page() -> None:
    before = RunLog.stage
    with stage_times() as (wall, cpu), RunLog("run", {}).stage("sleep"):
        time.sleep(0.1)
    assert wall["run: sleep"] >= 0.1 > 0.09 > cpu["run: sleep"]
    assert RunLog.stage is before
    row = Result({"stage": "run: sleep", "commit": "c"}, {"wall [s]": 2.0, "CPU [s]": 123.5})
    table = tables([row])[0].markdown()
    page = f"before\n<!-- budget: written by x -->\n{table}\n<!-- end -->\n| a | b |\n"
    assert recorded_cpu(page) == {"run: sleep": 123.5}


def test_formats_and_viewers_are_told_apart_by_what_they_lose(tmp_path: Path) -> None:
    g = ball()
    found = {r.labels["format"]: r.values for r in measure_formats(g, view_size=(96, 54))}
    assert len(found) == len(FORMATS)
    assert found["npz"]["PSNR [dB]"] == found["PLY"]["PSNR [dB]"] == 100  # equal to the last bit
    assert 25 < found["SPZ"]["PSNR [dB]"] < 80 < found["USD"]["PSNR [dB]"]
    assert 32.0 == found[".splat"]["size [B/splat]"] < found["PLY"]["size [B/splat]"]
    frames = write_tiny_capture(tmp_path, frames=4).frames
    surface = TriangleMesh(g.means[:3], np.array([[0, 1, 2]]), np.ones((3, 3)))
    shown = TrainedObject(g, [f.camera for f in frames], surface, {"1": load_test_views(frames)})
    ours, dilated, antialiased, classic, doubled = (
        r.values["PSNR at 1 [dB]"] for r in measure_viewers(shown)
    )
    assert dilated < doubled < classic - 3 < ours - 4  # dB: the capture shows these Gaussians
    assert dilated < antialiased < ours


def test_every_surface_stands_beside_the_fused_depth_and_parts_have_medians(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    open3d_or_skip()
    monkeypatch.setenv("DIGS_WARP_SAMPLE_DATA", str(tmp_path))  # the built-in object alone
    small = SimulateConfig(
        profile="bare-matcher", frames=10, width=128, height=72, samples_per_pixel=1
    )
    scope = Scope(tiers=("truth",), weights=(0.0, 0.2), recording=small, iterations=30)
    found = bench_surface(scope=scope)
    rows = {r.labels["surface"]: r.values for r in found if r.table == "objects"}
    assert list(rows) == [FUSED, "weight 0", "weight 0.2"]
    assert 0 < rows[FUSED][MILLIMETERS] < 20  # a pixel is 8 mm wide
    for values in rows.values():
        assert values[RATIO] == pytest.approx(values[MILLIMETERS] / rows[FUSED][MILLIMETERS])
    assert {r.labels["surface"]: r.values for r in found if r.table == "medians"} == rows

    def row(sensor: str, name: str, millimeters: float) -> Result:
        labels = {"sensor": sensor, "object": name, "surface": FUSED}
        return Result(labels, {MILLIMETERS: millimeters}, "objects")

    two = [row("law", "mug", 1.0), row("guided", "mug", 4.0), row("law", "cup", 3.0)]
    every = with_medians([*two, row("guided", "cup", 8.0)])
    assert [r.labels.get("object") for r in every] == ["mug", "cup", "mug", "cup", None, None]
    assert [r.values[MILLIMETERS] for r in every] == [1.0, 3.0, 4.0, 8.0, 2.0, 6.0]


def test_recordings_have_figures_and_a_failure_is_a_row_without(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    small = SimulateConfig(
        profile="bare-matcher", frames=10, width=64, samples_per_pixel=1, tier="law"
    )
    export_capture(simulate(small, tmp_path / "capture"), "tum", tmp_path / "rgbd/orbit")
    (orbit,) = recordings.measure_all([RealRecording("orbit", "tum")], tmp_path, 10)
    figures = {r.labels["poses"]: r.values for r in orbit.results}
    assert tuple(figures) == ("recorded", "estimated", "color and depth")
    values = figures["recorded"]
    assert values["frames"] == 10 and values["held out"] == 2 and values["PSNR [dB]"] > 8
    assert 0 < values["depth error [cm]"] < 30  # barely trained
    assert orbit.picture is not None and orbit.picture.shape == (2 * 36, 2 * 64, 3)
    # 64 pixels are too few to match images.
    assert figures["estimated"] == {"frames": 10}
    assert "structure from motion" in caplog.text
    assert find_benchmark("recordings").cases == tuple(each.name for each in RECORDINGS)


@pytest.mark.parametrize(("name", "frames"), LAYOUTS.items())
def test_readers_take_the_layouts(
    sample_data: Path, tmp_path: Path, name: str, frames: int
) -> None:
    source = sample_data / "rgbd" / name
    if not source.is_dir():
        pytest.skip(f"no {name} in the sample data")
    known = next(each for each in RECORDINGS if each.name == name)
    recording = read_recording(known.arrange(source, tmp_path), known.form)
    assert len(recording.frames) == frames
    posed = [frame.world_from_cam is not None for frame in recording.frames]
    assert all(posed) == known.has_poses
    assert known.has_poses == all(frame.depth is not None for frame in recording.frames)


def test_a_door_is_reduced_with_its_camera(tmp_path: Path) -> None:
    source, model = tmp_path / "door", tmp_path / "door/colmap_ground_truth"
    model.mkdir(parents=True)
    size = 10 * DOOR_REDUCTION
    (source / "images").mkdir()
    (source / "images/a.JPG").write_bytes(encode_jpeg(np.full((size, 2 * size, 3), 77, np.uint8)))
    (model / "cameras.txt").write_text(f"# one\n1 SIMPLE_RADIAL {2 * size} {size} 90 30 15 -0.1\n")
    (model / "images.txt").write_text("1 1 0 0 0 0 0 0 1 a.JPG\n\n")
    (model / "points3D.txt").write_text("")
    (frame,) = read_recording(smaller_door(source, tmp_path / "small"), "colmap").frames
    camera = frame.file_camera
    assert (camera.width, camera.height, camera.fx, camera.cx, camera.cy) == (20, 10, 30, 10, 5)


def test_realism_is_compared_on_the_built_in_object_where_there_is_no_data(tmp_path: Path) -> None:
    found = bench_realism(tmp_path, widths=(320,))
    summary = {r.labels["sensor"]: r.values for r in found if r.table == "agreement"}
    assert list(summary) == ["guided", "matcher, other noise", "matcher"]
    assert summary["matcher"]["rank correlation of failures"] == pytest.approx(1)
    assert summary["matcher"]["worst, object"] == 1
    assert summary["guided"]["rank correlation of failures"] > 0.9 < summary["guided"]["of RMS"]
    sure = [r.values for r in found if r.table == "confidence"]
    assert sum(row["matches, kept aside"] for row in sure) == pytest.approx(1)
    assert sure[-1]["right, kept aside"] > 0.9


def test_every_tier_of_the_sensor_is_told(tmp_path: Path) -> None:
    found = bench_sim(tmp_path, width=160)
    tiers = {r.labels["sensor"]: r.values for r in found if "sensor" in r.labels}
    assert set(tiers) == set(TIERS)
    for told in tiers.values():
        assert set(told) == {TIME, *COLUMNS.values()} and told[TIME] > 0
    truth = tiers["truth"]
    assert (truth["fill"], truth["bad-1"], truth["rms [px]"]) == (1, 0, 0)
