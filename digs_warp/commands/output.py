"""The rules for writing results: no file of the user's is deleted unless a flag says so."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from digs_warp.checks import DigsError
from digs_warp.data.capture import INDEX_NAME
from digs_warp.record.files import read_json
from digs_warp.record.layout import MANIFEST, RUN_RECORD
from digs_warp.record.run_log import RunRecord

OUTPUT_FLAGS = ("out", "resume", "overwrite")  # of `OutputFolder`


@dataclass(frozen=True, kw_only=True)
class OutputFolder:
    """Where the results go."""

    out: Path
    """Folder for the results. It must be new or empty, unless --resume or --overwrite is given."""

    resume: tyro.conf.FlagCreatePairsOff[bool] = False
    """Continue an interrupted run that had the same settings."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """First delete the results of an earlier run in this folder."""

    def __post_init__(self) -> None:
        if self.resume and self.overwrite:
            raise DigsError("--resume and --overwrite contradict each other; give one of them")

    def prepare(self, inputs: Sequence[Path | None] = ()) -> Path:
        """Make the folder ready to be written and return it.

        Args:
            inputs: what the command reads; it has to be there, and --overwrite must not delete it.

        Raises:
            DigsError: an input is missing, the folder is in use and no flag says what to do, or it cannot
                be overwritten.
        """
        needed = [path for path in inputs if path is not None]
        for path in needed:
            if not path.exists():  # found out now, before anything is deleted
                raise DigsError(f"'{path}': no such file or folder. Check the path.")
        if self.out.exists() and not self.out.is_dir():
            raise DigsError(f"--out '{self.out}': this is a file; name a folder")
        if self.overwrite and _is_used(self.out):
            _check_may_delete(self.out, needed)
            shutil.rmtree(self.out)
        elif _is_used(self.out) and not self.resume:
            raise DigsError(
                f"--out '{self.out}': the folder is not empty. Add --resume to go on with an "
                "interrupted run, --overwrite to start again, or name another folder."
            )
        return self.out


# Stands for a folder that is still to be named.
ANY_FOLDER = OutputFolder(out=tyro.MISSING)


def check_output_file(path: Path, overwrite: bool) -> None:
    """Raise a `DigsError` when ``path`` exists and may not be replaced."""
    if path.is_dir():
        raise DigsError(f"--out '{path}': this is a folder; name a file")
    if path.exists() and not overwrite:
        raise DigsError(f"--out '{path}': the file exists; add --overwrite or name another file")


def is_ours(folder: Path) -> bool:
    """Whether this program wrote ``folder``: it holds a run record or a capture index of ours."""
    try:
        if (folder / RUN_RECORD).is_file():
            return RunRecord.find(folder) is not None
        return "digs_warp" in read_json(folder / INDEX_NAME, "capture index")
    except DigsError:
        return False


def _is_used(folder: Path) -> bool:
    """Whether there is more in it than the record of a run that failed before it made anything."""
    if not folder.is_dir():
        return False
    names = {path.name for path in folder.iterdir()}
    return bool(names) and not (names <= {RUN_RECORD, MANIFEST} and is_ours(folder))


def _check_may_delete(folder: Path, inputs: Sequence[Path]) -> None:
    if not is_ours(folder):
        raise DigsError(
            f"--out '{folder}': --overwrite deletes only folders that digs-warp wrote, and this one "
            f"has no {RUN_RECORD} of ours. Delete it yourself or name another folder."
        )
    for path in [*inputs, Path.cwd()]:
        if path.resolve().is_relative_to(folder.resolve()):
            raise DigsError(
                f"--out '{folder}': --overwrite would delete '{path}', which this run needs; "
                "name another folder"
            )
