"""The pages of a study: every form holds the same numbers, and nothing from outside."""

import csv
import io
import re
from pathlib import Path

import numpy as np
from PIL import Image

from digs_warp.data.images import read_image
from digs_warp.study.charts import Chart, Curve
from digs_warp.study.page import Section, write_pages
from digs_warp.study.table import Table


def sections() -> list[Section]:
    table = Table("psnr", ["strategy", "PSNR [dB]"], [["a|b", "30.1"], ["<fusion>", "31.2"]])
    curves = [
        Curve("first", [1, 10, 100], [20, 25, 30], spread=[1, 1, 2]),
        Curve("second", [1, 10], [22, 21], line=False, notes=["law", "guided"]),
    ]
    chart = Chart("course", "Quality along time", curves, "seconds", "PSNR [dB]", log_x=True)
    return [Section("Quality", "More is better & slower.", [table], [chart])]


def test_all_files_are_written(tmp_path: Path) -> None:
    page = write_pages("A <study>", "What it asks.", sections(), tmp_path)
    rows = list(csv.reader((tmp_path / "tables" / "psnr.csv").read_text().splitlines()))
    assert rows == [["strategy", "PSNR [dB]"], ["a|b", "30.1"], ["<fusion>", "31.2"]]
    markdown = (tmp_path / "report.md").read_text()
    assert "| a\\|b | 30.1 |" in markdown
    assert "](plots/course.png)" in markdown
    html = page.read_text()
    assert "&lt;fusion&gt;" in html and "<fusion>" not in html and "<study>" not in html
    assert not re.search(r'(src|href)="(?!data:)', html)
    assert read_image(tmp_path / "plots" / "course.png").shape[1] == 864


def test_the_same_numbers_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_pages("A study", "What it asks.", sections(), tmp_path / name)
    for path in (tmp_path / "one").rglob("*.*"):
        twin = tmp_path / "two" / path.relative_to(tmp_path / "one")
        assert path.read_bytes() == twin.read_bytes(), path.name


def test_a_band_is_as_wide_above_a_curve_as_below() -> None:
    curve = Curve("flat", [0.0, 1.0], [5.0, 5.0], spread=[1.0, 1.0])
    data = io.BytesIO(Chart("band", "", [curve], "x", "y").png())
    picture = np.asarray(Image.open(data).convert("RGB"))
    column = picture[:, 3 * picture.shape[1] // 5].astype(int)
    blue = np.flatnonzero(column[:, 2] > column[:, 0] + 20)  # the band; the line is far bluer
    line = np.flatnonzero(column[:, 2] > column[:, 0] + 100)
    above, below = line.mean() - blue.min(), blue.max() - line.mean()
    assert above > 50 and abs(above - below) < 3
