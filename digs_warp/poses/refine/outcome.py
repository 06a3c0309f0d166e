"""What became of the poses. Imports nothing heavy: reading a result must not load the alignment."""

from dataclasses import dataclass


@dataclass(frozen=True)
class PoseRefinement:
    """Whether poses were refined, and why.

    Attributes:
        refined: whether they were.
        because: the reason, in words.
        moved_mm: root mean square motion of the cameras [mm]; 0 if they were not refined.
        turned_deg: the same of their rotation [degree].
        in_training: whether the cameras move further while the Gaussians are trained.
        adjusted: whether a bundle adjustment found the centers: the training then only turns the cameras.
    """

    refined: bool
    because: str
    moved_mm: float = 0.0
    turned_deg: float = 0.0
    in_training: bool = False
    adjusted: bool = False

    def __str__(self) -> str:
        if not self.refined:
            return f"not refined: {self.because}"
        moved = f"moved {self.moved_mm:.2f} mm and turned {self.turned_deg:.3f}°"
        return f"refined: {self.because}; {moved} (root mean square)"
