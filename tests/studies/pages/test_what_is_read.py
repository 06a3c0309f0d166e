"""The page on what is read is that of the table that the readers use."""

from digs_warp.formats.captures.formats import FILE_READERS, READERS
from digs_warp.formats.table import FILMS, RECORDINGS
from digs_warp.pipeline.scene_files import SUFFIXES
from digs_warp.sim.scene.mesh.read import UP_AXIS_BY_SUFFIX
from scripts.page_marks import DOCS
from studies.pages import what_is_read


def test_the_page_has_the_tables_of_the_readers() -> None:
    page = (DOCS / what_is_read.PAGE).read_text(encoding="utf-8")
    stale = [mark for mark, text in what_is_read.texts().items() if text.strip() not in page]
    assert stale == [], "run python -m studies page what-is-read"


def test_every_reader_has_its_row() -> None:
    assert RECORDINGS.keys() == READERS.keys()
    assert {form.name for form in FILMS} == FILE_READERS.keys()
    splats = [name for form in what_is_read.SPLATS for name in form.name.split(", ")]
    assert sorted([*splats, ".npz"]) == sorted(SUFFIXES)
    meshes = [name for form in what_is_read.MESHES for name in form.name.split(", ")]
    assert sorted(meshes) == sorted(UP_AXIS_BY_SUFFIX)
