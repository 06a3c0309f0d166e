"""Whether lengths are in metres, and how that is known."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MetricScale:
    """What is known about the unit of length of poses and points.

    Attributes:
        known: whether it is the metre; if not, it is arbitrary.
        because: what tells so, or what is missing.
    """

    known: bool
    because: str

    def __str__(self) -> str:
        """Say it in words, such as "unknown: the recording has no depth"."""
        return f"metres, by {self.because}" if self.known else f"unknown: {self.because}"

    @property
    def unit(self) -> str:
        """The unit of lengths, for figures: "m" or "units"."""
        return "m" if self.known else "units"


BY_DEPTH = MetricScale(True, "the depth maps")
BY_POSES = MetricScale(True, "the poses of the recording")
UNKNOWN = MetricScale(
    False,
    "the recording has no depth, and nothing says that its poses are in metres; give a known "
    "distance with --scale-from",
)
