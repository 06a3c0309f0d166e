"""Quality against millimeters for every weight of the depth, from records of the trade-off study."""

from typing import Any

from digs_warp.study.studies.held_surface import KNOB, WEIGHTS, surface_sections
from digs_warp.study.studies.tradeoff import cases, sections
from digs_warp.train.config import DEPTH_WEIGHT
from reference.study_records import record_of


def measured() -> list[dict[str, Any]]:
    """Records whose surface gets better and whose images get worse with the weight."""
    records = [record_of(case, number) for number, case in enumerate(cases(objects_count=1))]
    for record in records:
        weight = record["reconstruction"].get("train.depth_weight", DEPTH_WEIGHT)
        record["yardstick"]["psnr_object_in_place"] = 30.0 - 10 * weight
        surface = {"accuracy": 0.001 / (1 + 100 * weight), "completeness": 0.004}
        record["results"] |= {"surface": surface, "adherence": 0.0015}
    return records


def test_every_weight_has_its_point_in_ascending_order() -> None:
    (section,) = surface_sections(measured())
    (table,), (chart,) = section.tables, section.charts
    weights = sorted({*WEIGHTS, DEPTH_WEIGHT})
    assert [row[0] for row in table.rows] == [f"{weight:g}" for weight in weights]
    assert table.rows[0][1:] == ["30.00", "1.00", "4.00", "1.50"]
    assert list(chart.curves[0].y) == [30.0 - 10 * weight for weight in weights]
    assert list(chart.curves[0].x) == sorted(chart.curves[0].x, reverse=True)


def test_the_study_shows_the_curve_and_the_knob() -> None:
    titles = [section.title for section in sections(measured())]
    assert "Images against geometry" in titles
    assert KNOB.capitalize() in titles


def test_records_without_a_true_surface_have_no_curve() -> None:
    records = measured()
    for record in records:
        del record["results"]["surface"]
    assert surface_sections(records) == []
