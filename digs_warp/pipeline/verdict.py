"""What a reconstruction is worth, and what to do if that is little: from what the run measured."""

from collections.abc import Iterator, Sequence

import numpy as np

from digs_warp.check.evidence import neighbors, shared_points
from digs_warp.data.about import About
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.data.rig import Rig
from digs_warp.data.viewpoints import evenly
from digs_warp.init.start import Subject
from digs_warp.measure.scores import Scores
from digs_warp.measure.thumbnails import small_frames
from digs_warp.pipeline.records import OnObject, Poses, Verdict

# Frames that are looked at, evenly spread, beside the partners with which their depth is compared.
FRAMES = 12

# What is poor: depth on a smaller share of the object; depth that differs between views, or depth and a
# surface that are off, by more of its size; fewer pixels across it; views that match less [dB]; fewer of the
# frames.
LEAST_DEPTH, MOST_APART, MOST_OFF, SURFACE_OFF = 0.5, 0.06, 0.04, 0.03
LEAST_SPAN, LEAST_PSNR, LEAST_PLACED = 40.0, 20.0, 0.7

# An object is plain where the brightness changes by less from one thumbnail pixel to the next [of 255]: a
# white bowl 4.9, a plain boot 7.1, textured objects 8.8 to 22.
PLAIN = 7.0

# What to do: each of these once, and nothing that contradicts another.
NEARER = "come nearer, so that the object fills the image"
PIXELS = "record more pixels (--width)"
PROJECTOR = "use a camera with a projector (such as --profile d435), for the object is plain"
MATTER = "give it texture or dust it: stereo sees nothing on plain, shiny or transparent surfaces"
BASELINE = "use a camera whose eyes are farther apart"
CHECK = "see what 'digs-warp check' says of the recording"
VIEWS = "record more views, from all sides and two heights"


# How alike held-out views and photographs are from so many dB on: a word, and what the views do.
COARSE = "coarse"
LIKENESS = (
    (35.0, "excellent", "cannot be told from"),
    (30.0, "good", "are close to"),
    (25.0, "fair", "resemble"),
    (-np.inf, COARSE, "roughly resemble"),
)
# As near as this many times what the camera measures is nearly as near.
NEARLY = 1.5
# Of everything in view, with what is far and seen once, so much less is as good [dB].
SCENE_PSNR = 5.0


def likeness(psnr: float, subject: Subject) -> tuple[str, str]:
    """Return how alike held-out views and photographs are: a word, and what the views do; NaN: nothing."""
    if np.isnan(psnr):
        return "", ""
    alike = psnr + (SCENE_PSNR if subject == "scene" else 0.0)
    return next((word, do) for least, word, do in LIKENESS if not alike < least)


def on_object(frames: Sequence[Frame]) -> OnObject:
    """Measure frames with their final poses; masks, where there are some, show the object."""
    pairs = evenly(neighbors(frames), FRAMES)
    numbers = sorted({number for pair in pairs for number in pair})
    small = {n: each.alone for n, each in small_frames(frames, numbers).items()}
    if not small:
        return OnObject()
    masks = {n: each.shown for n, each in small.items()}
    inside = np.concatenate([each.depth[masks[n]] for n, each in small.items()])
    steps = [np.hypot(*np.gradient(f.green))[masks[n]] for n, f in small.items()]
    if not inside.size:
        return OnObject(depth=0.0, span=0.0)
    first = next(iter(small))
    scale = frames[first].camera.intrinsics.width / small[first].depth.shape[1]
    seen = [shared_points(small[a], small[b]) for a, b in pairs if {a, b} <= small.keys()]
    apart = np.concatenate([each.depth - each.measured for each in seen] or [np.empty(0)])
    return OnObject(
        depth=float(np.isfinite(inside).mean()),
        span=scale * float(np.median([np.sqrt(mask.sum()) for mask in masks.values()])),
        apart=_median(np.abs(apart)),
        off=_median(np.concatenate([_error(frames[n]) for n in evenly(numbers, FRAMES // 2)])),
        steps=float(np.median(np.concatenate(steps))),
    )


def _error(frame: Frame) -> np.ndarray:
    """Return the errors of the measured depth inside the mask [m]; empty where the truth is not recorded."""
    if not (frame.has(Layer.DEPTH_TRUE) and frame.has(Layer.DEPTH)):
        return np.empty(0)
    error = np.abs(frame.load_depth() - frame.load_depth_true())
    return error[frame.load_mask() > 127] if frame.has(Layer.MASK) else error.reshape(-1)


def _median(values: np.ndarray) -> float | None:
    values = values[np.isfinite(values)]
    return float(np.median(values)) if len(values) else None


def verdict(
    poses: Poses,
    scores: Scores,
    adherence: float | None,
    gaussians: Gaussians,
    about: About,
    rig: Rig | None,
) -> Verdict:
    """Return what a result is worth.

    Args:
        poses: the record of the poses, with its frames.
        scores: how well held-out views match.
        adherence: median distance of the surface to the measured depth [m]; None: there is none.
        gaussians: the result; they tell how large the object is.
        about: what is known of the recording.
        rig: its camera.
    """
    seen = on_object(poses.posed.training)
    power = (about.sensor or {}).get("projector_power", 0)
    projects = bool(power) or (rig is not None and rig.infrared is not None)
    helps = seen.steps is not None and seen.steps < PLAIN and not projects
    poor = [*_poor(poses, scores, seen, _size(gaussians), (PROJECTOR,) if helps else ())]
    if not poor:
        good = [*_good(poses, scores, adherence, seen)]
        words = "; ".join(each for _, each in good if each) or "nothing to object"
        return Verdict(True, tuple(what for what, _ in good), (), seen, f"good: {words}")
    because = tuple(what for what, _ in poor)
    advice = tuple(dict.fromkeys(each for _, todo in poor for each in todo))
    words = f"poor, because {'; '.join(because)}. To do: {'; '.join(advice)}"
    return Verdict(False, because, advice, seen, words)


def _size(gaussians: Gaussians) -> float:
    """Return the longest side of what most Gaussians lie in [m]; infinite where there are none."""
    if not len(gaussians):
        return np.inf
    return float(np.ptp(np.quantile(gaussians.means, (0.02, 0.98), axis=0), axis=0).max())


def _psnr(poses: Poses, scores: Scores) -> float:
    """Return how well held-out views match in their own exposures [dB]; NaN: nothing was held out."""
    is_object = poses.subject == "object"
    return scores.mean.psnr_object_aligned if is_object else scores.mean.psnr_frame_aligned


def _poor(
    poses: Poses, scores: Scores, seen: OnObject, size: float, first: tuple[str, ...]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield what is poor, and what to do about it; ``first`` is what helps against bad depth."""
    what = f"the {poses.subject}"
    if poses.errors:
        yield f"the recording contradicts itself ({', '.join(poses.errors)})", (CHECK,)
    if poses.sfm is not None and poses.sfm.registered < LEAST_PLACED * poses.sfm.images:
        yield f"only {poses.sfm.registered} of {poses.sfm.images} images were placed", (VIEWS,)
    if seen.span is not None and seen.span < LEAST_SPAN and poses.subject == "object":
        yield f"{what} is only {seen.span:.0f} px wide", (NEARER, PIXELS)
    if seen.depth is not None and seen.depth < LEAST_DEPTH:
        yield f"depth covers {seen.depth:.0%} of {what}", (*(first or (MATTER,)), NEARER)
    surface = scores.surface.accuracy if scores.surface else None
    for name, error, most in (
        ("the measured depth of neighboring views differs by", seen.apart, MOST_APART),
        ("the measured depth is off by", seen.off, MOST_OFF),
        ("the surface is off by", surface, SURFACE_OFF),
    ):
        if error is not None and error > most * size:
            share = f"{1e3 * error:.1f} mm, {error / size:.0%} of {what}"
            yield f"{name} {share}", (*first, NEARER, PIXELS, BASELINE)
    if (psnr := _psnr(poses, scores)) < LEAST_PSNR:
        yield f"held-out views match to {psnr:.1f} dB only", (CHECK, VIEWS)


def _good(
    poses: Poses, scores: Scores, adherence: float | None, seen: OnObject
) -> Iterator[tuple[str, str]]:
    """Yield what was measured of a good result, and what that is like in plain words; one may be empty."""
    surface = scores.surface.accuracy if scores.surface else None
    near = ""
    if surface is not None and seen.off is not None:
        near = _nearness(surface, seen.off, "the surface", "the camera measures")
    elif adherence is not None and seen.apart is not None:
        near = _nearness(adherence, seen.apart, "the measured depth", "neighboring views agree")
    if seen.depth is not None:
        yield f"depth on {seen.depth:.0%} of the {poses.subject}", near
    if seen.apart is not None:
        yield f"measured depth of neighboring views within {1e3 * seen.apart:.1f} mm", ""
    if not np.isnan(psnr := _psnr(poses, scores)):
        like = f"held-out views {likeness(psnr, poses.subject)[1]} the photographs"
        yield f"held-out views match to {psnr:.1f} dB", like


def _nearness(error: float, usual: float, what: str, who: str) -> str:
    if error > NEARLY * usual > 0:
        return f"{error / usual:.1f} times as far from {what} as {who}"
    nearly = "nearly " if error > usual > 0 else ""
    return f"{nearly}as near to {what} as {who}"
