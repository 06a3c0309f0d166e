"""How far a surface lies from the true one. Imports nothing heavy: reading a result needs it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SurfaceError:
    """Distances between the rendered and the true surface [m].

    Attributes:
        accuracy: mean distance of the rendered surface to the true one.
        completeness: mean distance of the true surface to the rendered one; what no camera saw counts.
        seen_completeness: the same of what cameras saw alone; None where that is not known.
    """

    accuracy: float
    completeness: float
    seen_completeness: float | None = None
