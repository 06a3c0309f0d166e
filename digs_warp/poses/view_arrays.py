"""The views that are compared, as the arrays that kernels read: those of all frames behind one another."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from digs_warp.poses.lookup import Target
from digs_warp.poses.views import View


def arrays_of(views: Sequence[View]) -> list[wp.array]:
    """Return the first point of each frame, all points and their values, `Target`s, images and depth."""
    sizes = np.cumsum([0, *(view.image.size for view in views)])
    form: Any = Target.numpy_dtype()
    rows = [_target(view, int(at)) for view, at in zip(views, sizes, strict=False)]
    counts = np.cumsum([0, *(len(view.points) for view in views)])
    return [
        wp.array(counts.astype(np.int32), dtype=int, device="cpu"),
        wp.array(np.concatenate([view.points for view in views]), dtype=wp.vec3, device="cpu"),
        _floats([view.values for view in views]),
        wp.array(np.array(rows, dtype=form), dtype=Target, device="cpu"),
        _floats([view.image.reshape(-1) for view in views]),
        _floats([view.picture.depth.reshape(-1) for view in views]),
    ]


def _target(view: View, offset: int) -> tuple[object, ...]:
    k, picture = view.picture.intrinsics, view.picture
    motion = (tuple(picture.turn), tuple(picture.shift))
    return (offset, k.width, k.height, k.fx, k.fy, k.cx, k.cy, *motion)


def _floats(parts: Sequence[np.ndarray]) -> wp.array:
    return wp.array(np.concatenate(parts).astype(np.float32), dtype=float, device="cpu")
