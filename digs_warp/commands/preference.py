"""`digs-warp preference make|evaluate`: ask people which reconstruction they prefer."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command, Group
from digs_warp.commands.output import NewFolder
from digs_warp.settings import FRAME_RATE, SIDE, Range
from digs_warp.words import counted


@dataclass(frozen=True, kw_only=True)
class MakeKit(Command):
    """Film four reconstructions side by side in four versions, with answer sheets and a secret key."""

    items: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="ITEM")]
    """Folders, one per question. Each has the same four subfolders with reconstructions of one object, named
    after what is compared, for example default, highdepth, fusion and random."""

    output: Annotated[NewFolder, tyro.conf.OmitArgPrefixes]

    seconds: Annotated[float, Range(0.01, 3600)] = 8.0
    """Length of a turn around the object [s]."""

    fps: Annotated[float, FRAME_RATE] = 24.0
    """Frames per second."""

    width: Annotated[int, Range(16, SIDE.high)] = 480
    """Width of each of the four pictures [px]."""

    height: Annotated[int, Range(16, SIDE.high)] = 360
    """Height of each of the four pictures [px]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.items:
            raise DigsError(
                "ITEM: none given, expected at least one folder with four reconstructions in it, for "
                "example 'digs-warp preference make mug bottle --out kit'"
            )

    def execute(self) -> str:
        """Film, and explain what to hand out."""
        from digs_warp.study.preference.design import KEY, VERSIONS
        from digs_warp.study.preference.kit import find_items, make_kit

        items = find_items(self.items)
        size = (self.width, self.height)
        with self.output.opened(self.items) as folder:
            make_kit(items, folder, size=size, seconds=self.seconds, frame_rate=self.fps)
        return (
            f"{self.output.out}: {VERSIONS} versions of {counted(len(items), 'question')}. Give the next "
            f"participant the next version (sheet.html and its videos); the page saves the answers as a "
            f"CSV file. Keep {KEY} to yourself."
        )


@dataclass(frozen=True, kw_only=True)
class EvaluateSheets(Command):
    """Count filled answer sheets and test whether the preference can be chance (chi-square test)."""

    sheets: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SHEET")]
    """CSV files, one per participant or many in one: columns participant, version, question, choice."""

    key: Path
    """The key.json of the kit, which says what stood where."""

    def __post_init__(self) -> None:
        if not self.sheets:
            raise DigsError("SHEET: none given, expected at least one filled answers.csv")

    def execute(self) -> str:
        """Return counts, shares and p values."""
        from digs_warp.study.preference.design import load_key
        from digs_warp.study.preference.evaluate import evaluate, read_answers

        key = load_key(self.key)
        answers = [answer for sheet in self.sheets for answer in read_answers(sheet, key)]
        strategies = sorted({name for places in key.values() for name in places.values()})
        return evaluate(answers, strategies).text()


PREFERENCE = Group(
    "Ask people which of four reconstructions they prefer, without telling them which is which.",
    {"make": MakeKit, "evaluate": EvaluateSheets},
)
