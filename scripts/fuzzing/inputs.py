"""Damaged inputs: each follows from (seed, kind, number) and the originals, and can be kept for later."""

import json
import random
import re
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from fuzzing.damage import damaged
from fuzzing.originals import Originals
from fuzzing.worker import Job, Outcome

NOTE = "fuzz.json"

# Names of the folder in which an input lies.
FOLDERS = ("input", "input", "input", "odd {0} %s ünter", "-x 'y'")


@dataclass(frozen=True)
class Input:
    """One file to damage.

    Attributes:
        folder: of `Originals`, whose copy is the working folder of the commands.
        damaged: the file, relative to the folder.
        lines: what follows ``digs-warp`` on each command line; ``OUT`` is a new file or folder.
        only: patterns of the files and folders that are copied; empty: all.
    """

    folder: str
    damaged: str
    lines: tuple[str, ...]
    only: tuple[str, ...] = ()


@dataclass(frozen=True)
class Kind:
    """Inputs that one row of the table counts."""

    name: str
    inputs: tuple[Input, ...]


@dataclass(frozen=True)
class Inputs:
    """The inputs of a run.

    Attributes:
        originals: the healthy files.
        folder: for the inputs while they are read.
        seed: decides every fault.
    """

    originals: Originals
    folder: Path
    seed: int

    def healthy(self, kind: Kind) -> list[Job]:
        """Write every healthy input of a kind, for one process.

        Inputs that differ only in which file is damaged are one and the same while they are healthy.
        """
        place = Path(tempfile.mkdtemp(prefix="healthy-", dir=self.folder))
        different = {(each.folder, each.only, each.lines): each for each in kind.inputs}
        return [
            Job(kind.name, self._place(each, place / f"{slug(kind)}-{number}"), each.lines)
            for number, each in enumerate(different.values())
        ]

    def write(self, kind: Kind, number: int) -> Job:
        """Write the damaged input ``number`` of a kind."""
        rng = random.Random(f"{self.seed} {kind.name} {number}")
        chosen = kind.inputs[number % len(kind.inputs)]
        folder = self._place(chosen, self.folder / f"{slug(kind)}-{number}" / rng.choice(FOLDERS))
        file = folder / chosen.damaged
        file.write_bytes(damaged(file.read_bytes(), file.name, rng))
        return Job(kind.name, folder, chosen.lines)

    def remove(self, job: Job) -> None:
        """Delete an input and what was written beside it."""
        shutil.rmtree(job.folder.parent)

    def keep(self, kind: Kind, number: int, outcome: Outcome, place: Path) -> Path:
        """Write the input once more, to ``place``, with a note; return its folder."""
        job = self.write(kind, number)
        target = place / f"{slug(kind)}-{self.seed}-{number}"
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(job.folder, target)
        self.remove(job)
        note = {"kind": kind.name, "lines": job.lines, "end": outcome.end, "detail": outcome.detail}
        (target / NOTE).write_text(json.dumps(note, indent=2))
        return target

    def _place(self, chosen: Input, target: Path) -> Path:
        source = self.originals.make(chosen.folder)
        shutil.rmtree(target, ignore_errors=True)
        if not chosen.only:
            shutil.copytree(source, target)
        for path in [path for name in chosen.only for path in source.glob(name)]:
            copy = target / path.relative_to(source)
            copy.parent.mkdir(parents=True, exist_ok=True)
            (shutil.copytree if path.is_dir() else shutil.copyfile)(path, copy)
        return target


def slug(kind: Kind) -> str:
    """Return the name of a kind as a file name."""
    return re.sub(r"\W+", "-", kind.name.lower()).strip("-")
