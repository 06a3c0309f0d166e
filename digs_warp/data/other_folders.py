"""Folders that are taken for captures: what they are, and where the capture is."""

from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.record import layout
from digs_warp.record.noted_paths import places_of
from digs_warp.record.run_log import RunRecord
from digs_warp.words import counted

OF_A_CAMERA = "'digs-warp convert FOLDER --from FORM --out CAPTURE' makes one of a real recording."


def what_it_is(folder: Path, index_name: str) -> str:
    """Return what a folder without ``index_name`` is, and what to do, in sentences."""
    if (folder / layout.CAPTURE / index_name).is_file():
        return (
            f"It holds the results of 'digs-warp run'; its capture is '{folder / layout.CAPTURE}'."
        )
    if (folder / layout.DATA_SET).is_file():
        found = sorted(path.parent for path in folder.glob(f"*/{index_name}"))
        example = f", for example '{found[0]}'" if found else ""
        return f"It holds {counted(len(found), 'capture')}; name one of them{example}."
    record = _record_of(folder)
    if record is None and not (folder / layout.GAUSSIANS).is_file():
        return f"'digs-warp simulate' writes one. {OF_A_CAMERA}"
    if record is not None and record.command in ("simulate", "run"):
        return f"'digs-warp {record.command}' was interrupted here; run it again with --resume."
    command = record.command if record else "reconstruct"
    candidates = [folder.parent / layout.CAPTURE]
    if record is not None and record.results.get("capture"):
        candidates += places_of(Path(record.results["capture"]), folder)
    place = next((path for path in candidates if (path / index_name).is_file()), None)
    where = f"; its capture is '{place}'" if place else ""
    return f"It holds the results of 'digs-warp {command}'{where}."


def _record_of(folder: Path) -> RunRecord | None:
    try:
        return RunRecord.find(folder)
    except DigsError:  # broken, which does not matter here
        return None
