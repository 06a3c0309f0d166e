"""All results in words, where the time went, and the settings and versions that made the result."""

import shlex
from dataclasses import dataclass, is_dataclass
from html import escape
from itertools import chain
from math import isnan
from pathlib import Path
from typing import Any, get_args, get_type_hints

from digs_warp.data.capture import Capture
from digs_warp.pipeline.config import ReconstructConfig
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.layout import RUN_RECORD
from digs_warp.record.run_log import RunRecord
from digs_warp.record.typed import to_json
from digs_warp.settings import NO_FLAG
from digs_warp.show.report.markup import (
    UNKNOWN,
    card,
    details,
    flat_items,
    number,
    part,
    section,
    table,
)
from digs_warp.sim.config import SimulateConfig


@dataclass(frozen=True, eq=False)
class RunRecords:
    """The records of the capture, of the reconstruction and of the run as a whole; None: there is none.

    ``source`` is the folder of the capture.
    """

    capture: RunRecord | None
    reconstruction: RunRecord
    whole: RunRecord | None
    source: str

    @staticmethod
    def find(capture: Capture, result: Reconstruction, report: Path) -> "RunRecords":
        """Find the records in the capture and beside the report.

        The folder of a whole run holds the capture, the reconstruction and the report; a run.json beside
        the report that belongs to either of the two is not that of a whole run.
        """
        beside = report.parent.resolve()
        parts = [folder.resolve() for folder in (capture.stored_in, result.folder) if folder]
        whole = None if beside in parts else RunRecord.find(beside)
        recording = RunRecord.find(capture.stored_in) if capture.stored_in else None
        return RunRecords(recording, result.run, whole, str(capture.folder))

    def commands(self) -> list[list[str]]:
        """Return the command that did all of it, or those that did parts of it."""
        parts = filter(None, (self.capture, self.reconstruction))
        flags = {record.command: _flags(record) for record in parts}
        if self.whole:
            flags = {
                "run": {name: words for each in flags.values() for name, words in each.items()}
            }
        known = {
            "run": ["--out", "again"],
            "simulate": ["--out", self.source],
            "reconstruct": [self.source, "--out", "again"],
        }
        return [
            ["digs-warp", command, *known.get(command, []), *chain(*words.values())]
            for command, words in flags.items()
        ]

    @property
    def total_seconds(self) -> float:
        """Wall-clock time of all stages [s]."""
        parts = [self.whole] if self.whole else [self.capture, self.reconstruction]
        return sum(sum(_seconds(part).values()) for part in parts)


def figures_section(result: Reconstruction) -> str:
    """Return the part with what each stage found, but for what the tiles at the top tell."""
    titles = {"poses": "Poses", "start": "Points to start from", "training": "Training"}
    tables = [
        f"<h3>{title}</h3>{table(['', ''], rows.items())}"
        for stage, title in titles.items()
        if (rows := {k: v for k, v in result.figures.get(stage, {}).items() if k not in _IN_TILES})
    ]
    cards = f"<div class=cards>{''.join(_more_cards(result))}</div>"
    return part("figures", "All figures", "what each stage found and decided", cards, *tables)


# One number for a quantity: these are on tiles.
_IN_TILES = ("adherence to the measured depth", "training", "iterations", "initial points")


def _more_cards(result: Reconstruction) -> list[str]:
    """Return how good the result is, but for what the tiles at the top tell."""
    mean, surface = result.scores.mean, result.scores.surface
    ssim = mean.ssim_object if result.poses.subject == "object" else mean.ssim_frame
    cards = [card("Structure (SSIM)", number(ssim, 4), "", "held-out views", "ssim")]
    if surface is not None:
        seen, note = surface.seen_completeness, "mean distance of the true surface, where seen"
        if seen is None:
            seen, note = surface.completeness, "mean distance of the true surface"
        cards.append(card("Completeness", number(1e3 * seen, 2, "mm"), "", note, "completeness"))
        if (apart := result.training.adherence) is not None:
            note = "median distance to the measured depth"
            cards.append(card("Adherence", number(1e3 * apart, 2, "mm"), "", note, "adherence"))
    sizes = result.scores.other_sizes
    if sizes is not None and not isnan(sizes.double + sizes.half + sizes.trained):
        change = f"{sizes.double - sizes.trained:+.1f}, {sizes.half - sizes.trained:+.1f} dB"
        note = "PSNR from half and from twice the distance, against as trained"
        cards.append(card("Other distances", change, "", note, "distances"))
    return cards


def times_section(records: RunRecords) -> str:
    """Return the part with the stage times."""
    parts = {"simulation": records.capture, "reconstruction": records.reconstruction}
    rows = [
        (f"{group}: {stage}", number(seconds, 1, "s"))
        for group, record in parts.items()
        for stage, seconds in _seconds(record).items()
    ]
    # The whole run counts the two above as one stage each; its other stages come last.
    whole = _seconds(records.whole).items()
    rows += [(k, number(v, 1, "s")) for k, v in whole if k not in ("simulate", "reconstruct")]
    if not rows:
        return part("times", "Times", "no stage times were recorded")
    note = "<p>Frames are recorded side by side: their stages share the time that passes.</p>"
    fact = f"{records.total_seconds:.1f} s in all"
    return part("times", "Times", fact, table(["Stage", "Time"], rows), note)


def settings_section(records: RunRecords) -> str:
    """Return the section with the command that does the same again, what is not a default, and versions."""
    commands = [shlex.join(command) for command in records.commands()]
    named = {"Simulation": records.capture, "Reconstruction": records.reconstruction}
    tables = [
        f"<h3>{name}, other than the default</h3>{table(['Setting', 'Value'], changed)}"
        for name, record in named.items()
        if record and (changed := list(_changed(record).items()))
    ]
    versions = flat_items(records.reconstruction.versions)
    versions += flat_items(records.reconstruction.machine)
    if versions:
        tables.append(f"<h3>Versions</h3>{table(['Part', 'Version'], versions)}")
    lines = escape("\n".join(commands))
    return section(
        "The same again",
        "All other settings are the defaults; run.json has all of them (--config run.json).",
        f"<pre>{lines}</pre><button type=button name=copy>Copy</button>",
        details("Settings and versions", "".join(tables)) if tables else "",
        name="settings",
    )


# What a command was told, and settings whose flag has another name than its field.
_SETTINGS = {"simulate": SimulateConfig, "reconstruct": ReconstructConfig}
_FLAGS = {"density.strategy": "density"}


def _changed(record: RunRecord) -> dict[str, str]:
    """Return the settings of a record that are not the defaults, by their dotted names."""
    kind = _SETTINGS.get(record.command)
    usual = dict(flat_items(to_json(kind()))) if kind else {}
    return {k: v for k, v in flat_items(record.settings) if v != usual.get(k, UNKNOWN)}


def _flags(record: RunRecord) -> dict[str, list[str]]:
    """Return the flags that set what is not a default, with their words; a seed serves all stages."""
    found: dict[str, list[str]] = {}
    for dotted in _changed(record):
        *_, name = keys = dotted.split(".")
        value, hint = record.settings, _SETTINGS.get(record.command)
        for key in keys:
            value, hint = value[key], _type_of(hint, key)
        if hint is None:
            continue  # a setting of another version
        if name.endswith("seed"):
            name = "seed"
        elif NO_FLAG in getattr(hint, "__metadata__", ()):
            return {"--config": ["--config", RUN_RECORD]}
        flag = "--" + _FLAGS.get(".".join(keys[-2:]), name).replace("_", "-")
        words = value if isinstance(value, list) else [value]
        if isinstance(value, bool):
            flag, words = (flag if value else flag.replace("--", "--no-", 1)), []
        found[flag] = [flag, *map(str, words)]
    return found


def _type_of(kind: Any, field: str) -> Any:
    """Return the annotated type of a field of a dataclass; None where it is none, or has no such field."""
    plain = get_args(kind)[0] if hasattr(kind, "__metadata__") else kind
    return get_type_hints(plain, include_extras=True).get(field) if is_dataclass(plain) else None


def _seconds(record: RunRecord | None) -> dict[str, float]:
    return record.seconds if record else {}
