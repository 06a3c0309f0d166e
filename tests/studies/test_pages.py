"""Pages that the code writes show what the code has, and only pictures that may be shown."""

import json
import re
import shlex
from types import ModuleType

import numpy as np
import pytest

from digs_warp.formats.captures.formats import FILE_READERS, READERS
from digs_warp.formats.table import FILMS, RECORDINGS
from digs_warp.pipeline.scene_files import SUFFIXES
from digs_warp.sim.scene.mesh.read import UP_AXIS_BY_SUFFIX
from digs_warp.sim.sensor.color import COLOR_EFFECTS
from digs_warp.sim.sensor.effects import AFTER_MATCHING, EFFECTS
from digs_warp.study.catalogue import find_study
from reference.study_records import record_of
from scripts.page_marks import DOCS
from studies import real_recordings as recordings
from studies.pages import gallery, randomization, real_recordings, what_is_read
from studies.pages.published import portable
from studies.pages.sensor_pictures import TIERS_PICTURE, WITHOUT_PICTURE, SensorStudio


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("module", [randomization, what_is_read])
def test_tables_are_those_of_the_code(module: ModuleType) -> None:
    text = page(module.PAGE)
    stale = [mark for mark, table in module.texts().items() if table.strip() not in text]
    assert stale == [], f"run python -m studies page for {module.__name__}"


def test_every_reader_has_its_row() -> None:
    assert RECORDINGS.keys() == READERS.keys()
    films = {name for form in FILMS for name in form.name.split(", ")}
    assert films == FILE_READERS.keys() - READERS.keys()
    for forms, known in (
        (what_is_read.SPLATS, set(SUFFIXES) - {".npz"}),
        (what_is_read.MESHES, UP_AXIS_BY_SUFFIX),
    ):
        names = [name for form in forms for name in form.name.split(", ")]
        assert sorted(names) == sorted(known)


def test_the_gallery_shows_its_examples_and_no_other_pictures() -> None:
    sections = {each.partition("\n")[0]: each for each in page(gallery.PAGE).split("## ")[1:]}
    for example in gallery.EXAMPLES:
        section = sections[example.title]
        command = f"`{shlex.join(gallery.command(example, gallery.FOLDER / example.name))}`"
        shown = command, f"({gallery.PICTURES}/{example.name}.jpg)"
        assert all(each in section for each in (*shown, " Gaussians, PSNR ", example.credit))
        assert ("DATA" in example.flags) == bool(example.credit)
    pictures = {path.stem for path in (DOCS / gallery.PICTURES).iterdir()}
    assert pictures == {example.name for example in gallery.EXAMPLES}


def test_only_pictures_of_recordings_that_a_license_allows_are_here_and_credited() -> None:
    text = page("recordings.md")
    assert real_recordings.described(recordings.RECORDINGS) in text, "page real-recordings"
    pictures = {path.stem: path for path in (DOCS / real_recordings.PICTURES).iterdir()}
    allowed = {each.name: each.credit for each in recordings.RECORDINGS if each.pictures_allowed}
    assert pictures.keys() <= allowed.keys()
    for name, path in pictures.items():
        assert f"({real_recordings.PICTURES}/{path.name})\n\n*Images: {allowed[name]}.*" in text
        assert path.stat().st_size <= real_recordings.LARGEST
    noise = np.random.default_rng(0).integers(0, 256, (720, 960, 3), dtype=np.uint8)
    assert len(real_recordings.small_jpeg(noise)) <= real_recordings.LARGEST


def test_every_effect_shows_on_the_still_life_and_on_its_page() -> None:
    studio = SensorStudio()
    idle = {e.name for e in EFFECTS if not e.choose(studio.facts, studio.rig).on}
    assert idle == set(WITHOUT_PICTURE)
    for effect in AFTER_MATCHING:
        if effect.name in idle:
            continue
        figure = studio.depth_figure(effect)
        assert figure.changed.sum() >= 100, effect.name
        # Beside holes there are errors, and nothing else is touched.
        untouched = figure.sensed.disparity[~figure.changed]
        np.testing.assert_array_equal(untouched, figure.truth.disparity[~figure.changed])
    depth, color = ([effect.name for effect in effects] for effects in (EFFECTS, COLOR_EFFECTS))
    assert set(re.findall(r"^\| `(\S+)` \|", page("sensor.md"), re.MULTILINE)) >= {*depth, *color}
    pictures = {path.stem for path in (DOCS / "images/sensor").glob("*.jpg")}
    assert pictures == {TIERS_PICTURE, *depth} - set(WITHOUT_PICTURE)


def test_no_path_of_this_machine_is_published() -> None:
    record = record_of(find_study("robustness").cases(1, 1, 300)[0], 0)
    record["recording"] |= {"mesh": "/home/me/mug.glb", "environment": "/home/me/sky.hdr"}
    published = portable(record)
    assert "/home" not in json.dumps(published)
    assert published["recording"]["mesh"] == "mug.glb"
