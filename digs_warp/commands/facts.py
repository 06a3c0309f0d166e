"""Facts for the terminal: a name and what is known, one per line."""

from typing import TYPE_CHECKING

from digs_warp.words import counted

if TYPE_CHECKING:
    from digs_warp.pipeline.reconstruction import Reconstruction


def format_facts(facts: dict[str, str]) -> str:
    """Return the facts as two aligned columns."""
    width = max(map(len, facts))
    return "\n".join(f"{name.ljust(width)}  {value}" for name, value in facts.items())


def reconstruction_words(result: "Reconstruction", frames: int) -> str:
    """Say how many Gaussians there are, from what, and how good they are."""
    depth = result.start.depth if result.start else None
    scale = result.poses.metric_scale
    is_known = scale is None or scale.known
    voxels = ""
    if depth:
        size = f"{1e3 * depth.voxel_size:.3g} mm" if is_known else f"{depth.voxel_size:.3g} units"
        voxels = f" in voxels of {size}"
    gaussians = counted(len(result.gaussians), "Gaussian")
    unknown = [] if is_known else ["scale unknown"]
    words = [f"{gaussians} from {counted(frames, 'frame')}{voxels}", result.quality]
    words += [str(result.scores.surface)] if result.scores.surface else []
    adherence = result.training.adherence
    words += [f"adherence to the measured depth {1e3 * adherence:.2f} mm"] if adherence else []
    return ", ".join(words + unknown)
