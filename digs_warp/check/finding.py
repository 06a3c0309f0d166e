"""What a look at a capture finds: what is wrong, and how it is likely mended."""

from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "depth unit",
    "scale",
    "focal length",
    "pose convention",
    "depth along rays",
    "time stamps",
    "order",
    "path",
    "alignment",
    "masks inverted",
    "masks moved",
    "masks cut",
    "masks disagree",
    "moving things",
    "change",
    "still camera",
    "pose jump",
    "odd frames",
    "break",
    "parts",
    "few views",
    "repeats",
    "gap",
    "blur",
    "exposure",
]

# A reconstruction in spite of these can be used, though it will be worse.
WARNINGS: frozenset[Kind] = frozenset(
    (
        "masks disagree",
        "moving things",
        "change",
        "still camera",
        "pose jump",
        "odd frames",
        "parts",
        "few views",
        "repeats",
        "gap",
        "blur",
        "exposure",
    )
)


@dataclass(frozen=True)
class Finding:
    """Something in a capture that does not fit together, or is worse than it could be.

    Attributes:
        kind: what it is about.
        what: what was measured and what it means, a sentence or two.
        mend: what to do about it, a sentence or two.
    """

    kind: Kind
    what: str
    mend: str

    @property
    def is_error(self) -> bool:
        """Whether no good reconstruction can come of the capture as it is."""
        return self.kind not in WARNINGS

    def __str__(self) -> str:
        return f"{self.what} {self.mend}"
