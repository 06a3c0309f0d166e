"""What the inputs of each kind came to, as a table."""

from dataclasses import dataclass, field

from digs_warp.study.table import Table
from fuzzing.worker import Outcome

HEADINGS = (
    *("kind", "inputs", "read", "refused", "tracebacks", "crashes"),
    *("above 1 GB", "above 10 s", "most memory [MB]", "longest [s]"),
)


@dataclass
class Tally:
    """The outcomes of one kind of input."""

    outcomes: list[Outcome] = field(default_factory=list)

    def row(self, name: str) -> list[str]:
        """Return the row of the table."""
        ends = [outcome.end for outcome in self.outcomes]
        counts = [
            ends.count(end) for end in ("read", "refused", "traceback", "crash", "memory", "time")
        ]
        worst = max((outcome.megabytes for outcome in self.outcomes), default=0.0)
        longest = max((outcome.seconds for outcome in self.outcomes), default=0.0)
        return [
            name,
            f"{len(ends):,}",
            *(f"{count:,}" for count in counts),
            f"{worst:.0f}",
            f"{longest:.1f}",
        ]


def table(tallies: dict[str, Tally]) -> Table:
    """Return one row per kind, and their sum."""
    rows = [tally.row(name) for name, tally in tallies.items()]
    everything = Tally([outcome for tally in tallies.values() for outcome in tally.outcomes])
    return Table("", list(HEADINGS), [*rows, everything.row("all")])
