"""All results in words, where the time went, and the settings and versions that made the result."""

from dataclasses import dataclass
from pathlib import Path

from digs_warp.data.capture import Capture
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record.run_log import RunRecord
from digs_warp.show.report.markup import chart, flat_items, section, table
from digs_warp.show.report.plots import Bar, bar_chart


@dataclass(frozen=True, eq=False)
class RunRecords:
    """The records of the capture, of the reconstruction and of the run as a whole; None: there is none."""

    capture: RunRecord | None
    reconstruction: RunRecord
    whole: RunRecord | None

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
        return RunRecords(recording, result.run, whole)

    @property
    def total_seconds(self) -> float:
        """Wall-clock time of all stages [s]."""
        parts = [self.whole] if self.whole else [self.capture, self.reconstruction]
        return sum(sum(_seconds(part).values()) for part in parts)


def figures_section(result: Reconstruction) -> str:
    """Return the section of the results of each stage, as run.json holds them."""
    titles = {
        "poses": "Poses",
        "start": "Points to start from",
        "training": "Training",
        "scores": "Evaluation",
        "verdict": "Verdict",
    }
    tables = [
        f"<h3>{titles[stage]}</h3>{table(['', ''], rows.items())}"
        for stage, rows in result.figures.items()
        if rows
    ]
    intro = "What each stage found and decided."
    return section("Figures", intro, *tables)


def times_section(records: RunRecords) -> str:
    """Return the section of the stage times."""
    bars = [
        Bar(f"{group}: {stage}", seconds, group)
        for group, record in (
            ("simulation", records.capture),
            ("reconstruction", records.reconstruction),
        )
        for stage, seconds in _seconds(record).items()
    ]
    # The whole run counts the two above as one stage each; its other stages come last.
    covered = {"simulate", "reconstruct"}
    others = {k: v for k, v in _seconds(records.whole).items() if k not in covered}
    bars += [Bar(stage, seconds, "rest") for stage, seconds in others.items()]
    if not bars:
        return section("Times", "No stage times were recorded.")
    longest = max(bars, key=lambda bar: bar.value)
    alt = f"Seconds per stage; the longest is {longest.label} with {longest.value:.1f} s"
    caption = "Frames are recorded side by side: their stages share the time that passes."
    rows = [(bar.label, f"{bar.value:.2f}") for bar in bars]
    rows += [
        (f"whole run: {stage}", f"{seconds:.2f}")
        for stage, seconds in _seconds(records.whole).items()
        if stage in covered
    ]
    return section(
        "Times",
        f"{records.total_seconds:.1f} seconds in all.",
        "<div class=columns>",
        chart(bar_chart(bars, "seconds"), alt, caption),
        table(["Stage", "Seconds"], rows),
        "</div>",
    )


def settings_section(records: RunRecords) -> str:
    """Return the section of settings, versions and machine."""
    named = {"Simulation": records.capture, "Reconstruction": records.reconstruction}
    tables = [
        f"<div><h3>{name}</h3>{table(['Setting', 'Value'], flat_items(record.settings))}</div>"
        for name, record in named.items()
        if record and record.settings
    ]
    versions = flat_items(records.reconstruction.versions)
    versions += flat_items(records.reconstruction.machine)
    if versions:
        tables.append(f"<div><h3>Versions</h3>{table(['Part', 'Version'], versions)}</div>")
    return section(
        "Settings",
        "Everything needed to reproduce this result.",
        f"<div class=columns>{''.join(tables)}</div>",
    )


def _seconds(record: RunRecord | None) -> dict[str, float]:
    return record.seconds if record else {}
