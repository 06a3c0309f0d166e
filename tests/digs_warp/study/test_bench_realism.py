"""The realism benchmark on the built-in object, and what its charts show."""

from pathlib import Path

import numpy as np
import pytest

from digs_warp.study import bench_realism as bench
from digs_warp.study.realism_confidence import KEPT_ASIDE, MARGIN, confidence_charts
from digs_warp.study.realism_scenes import places
from digs_warp.study.results import Result, tables


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> list[Result]:
    """There is no sample data in an empty folder."""
    return bench.bench_realism(tmp_path_factory.mktemp("data"), widths=(320,))


def rows(results: list[Result], table: str) -> dict[str, dict[str, float]]:
    return {r.labels["sensor"]: dict(r.values) for r in results if r.table == table}


def test_it_compares_on_the_built_in_object_where_there_is_no_data(results: list[Result]) -> None:
    summary = rows(results, "agreement")
    assert list(summary) == ["guided", "matcher, other noise", "matcher"]
    assert summary["matcher"]["rank correlation of failures"] == pytest.approx(1)
    assert summary["matcher"]["worst, object"] == 1
    assert summary["guided"]["rank correlation of failures"] > 0.9
    assert summary["guided"]["of RMS"] > 0.9
    frames = rows(results, "frames")
    kept = "bad pixels bad in the next frame"
    assert frames["guided"][kept] == pytest.approx(frames["matcher"][kept], abs=0.12)


def test_time_is_told_beside_that_of_the_full_search(results: list[Result]) -> None:
    times = rows(results, "time")
    assert list(times) == ["guided", "matcher", "matcher, search alone"]
    assert times["guided"]["time / guided's"] == 1
    for name in ("matcher", "matcher, search alone"):
        ratio = times[name]["time [ms/MP]"] / times["guided"]["time [ms/MP]"]
        assert times[name]["time / guided's"] == pytest.approx(ratio)


def test_the_shares_of_the_confidences_add_up(results: list[Result]) -> None:
    for sensor in ("guided", "matcher", MARGIN):
        mine = [r for r in results if r.table == "confidence" and r.labels["sensor"] == sensor]
        *ranges, all_of_them = mine
        assert all_of_them.labels["confidence"] == "all"
        shares = np.array([r.values["share of the matches"] for r in ranges])
        wrong = [r.values["wrong"] for r in ranges]
        assert shares.sum() == pytest.approx(1)
        assert shares @ wrong == pytest.approx(all_of_them.values["wrong"])
        assert wrong[0] > 3 * wrong[-1]  # the least trusted, the most trusted
    names = [table.name for table in tables(results)]
    assert names.count("confidence") == 1


def test_charts_show_each_confidence_and_the_scenes_kept_aside(results: list[Result]) -> None:
    reliability, trust = confidence_charts(results)
    assert [c.label for c in reliability.curves] == ["as stated", "guided", "matcher"]
    assert [c.label for c in trust.curves] == ["guided", "matcher", MARGIN]
    for curve in trust.curves:
        assert curve.x[-1] == pytest.approx(1)
        assert curve.y[0] < curve.y[-1]
    aside = [Result(r.labels, dict(r.values) | {KEPT_ASIDE: 0.5}, r.table) for r in results]
    assert confidence_charts(aside)[0].curves[-1].label == "guided, scenes kept aside"
    assert reliability.svg() and trust.png()


def test_every_other_mesh_is_kept_aside(tmp_path: Path) -> None:
    for name in ("b", "a", "c"):
        (tmp_path / "meshes" / name).mkdir(parents=True)
        (tmp_path / "meshes" / name / f"{name}.glb").touch()
    found = places(tmp_path)
    assert [(p.mesh.stem, p.tuned) for p in found if p.mesh] == [
        ("a", True),
        ("b", False),
        ("c", True),
    ]
    (built_in,) = places(tmp_path / "nothing")
    assert built_in.mesh is None and not built_in.tuned


def test_scenes_kept_aside_are_a_row_of_their_own() -> None:
    def row(scene: str, tuned: bool, sensor: str, bad: float) -> Result:
        labels = {"width": 320, "scene": scene, "tuned": tuned, "sensor": sensor}
        same = {"failures": bad, "rms": 1.0, "fill": 0.9, "small holes": 0.0}
        return Result(labels, same | {"bad-1, object": bad, "bad-1, surround": bad}, "scenes")

    several = [row("a", True, "guided", 0.1), row("b", False, "guided", 0.3)]
    several += [row(s, s == "a", n, 0.2) for s in "ab" for n in ("matcher", "matcher, other noise")]
    summary = {r.labels["sensor"]: r.values for r in bench._summary(several, (320,))}
    assert summary["guided, scenes kept aside"]["bad-1 / matcher's, object"] == pytest.approx(1.5)
    assert summary["guided"]["bad-1 / matcher's, object"] == pytest.approx(np.sqrt(0.75))
    assert summary["guided"]["worst, surround"] == pytest.approx(0.5)
