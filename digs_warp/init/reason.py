"""What a training starts from and why, in words: for the log, run.json and the report."""

from digs_warp.init.strategies import StrategyName

_FROM_DEPTH = "points from the depth maps"


def start_reason(strategy: StrategyName, sources: dict[str, int], has_depth: bool) -> str:
    """Return a phrase such as "the sparse points of the recording, which has no depth".

    Args:
        strategy: how the points were made.
        sources: number of points by where they came from, as in `Start`.
        has_depth: whether a frame has a depth map.
    """
    if strategy in ("depth", "highdepth", "fusion"):
        sparse = ", and sparse points matched in the images" if strategy == "fusion" else ""
        closed = "; closed where no view saw the object" if "unseen" in sources else ""
        return _FROM_DEPTH + sparse + closed
    if strategy == "hull":
        return "the visual hull of the masks" + (
            "" if has_depth else "; the recording has no depth"
        )
    if strategy == "random":
        return "random points" if has_depth else "random points; the recording has no depth"
    if "recorded" in sources:
        return "the sparse points of the recording" + ("" if has_depth else ", which has no depth")
    lacks = "" if has_depth else "; the recording has neither depth nor usable sparse points"
    return "sparse points matched in the images" + lacks
