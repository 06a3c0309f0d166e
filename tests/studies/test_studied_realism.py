"""The realism benchmark on the built-in object, and what its charts show."""

from pathlib import Path

import numpy as np
import pytest

from studies import realism as bench
from studies.realism_scenes import places
from studies.results import Result


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
