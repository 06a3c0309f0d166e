"""Recordings of the same things in the same surround share one renderer, with the light it has measured.

Several walks around an object, or the same walk at rising noise, then prepare it once, also where a few
scenes take turns.
"""

import hashlib
from dataclasses import fields, is_dataclass
from threading import Lock
from typing import Any

import numpy as np

from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Scene

# What the arrays of all scenes that are kept may have together [bytes]: the training that follows may want
# the memory. One that is larger alone is not kept.
LARGEST = 128 << 20

_lock = Lock()
# With their sizes; the one used last stands last.
_kept: dict[bytes, tuple[RaycastRenderer, int]] = {}


def renderer_of(scene: Scene, environment: Environment) -> RaycastRenderer:
    """Return a renderer; one that this process used lately, if that was of an equal scene and surround."""
    size = _size((scene, environment))
    if size > LARGEST:
        return RaycastRenderer(scene, environment)
    digest = hashlib.blake2b()
    _read((scene, environment), digest.update)
    key = digest.digest()
    with _lock:
        if key in _kept:
            _kept[key] = _kept.pop(key)
        else:
            _make_room(size)
            _kept[key] = (RaycastRenderer(scene, environment), size)
        return _kept[key][0]


def _make_room(size: int) -> None:
    """Let go of those that were not used for the longest time."""
    while _kept and size + sum(kept for _, kept in _kept.values()) > LARGEST:
        del _kept[next(iter(_kept))]


def _size(value: Any) -> int:
    """Return how many bytes the arrays of nested dataclasses and tuples have."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    return sum(map(_size, _parts(value)))


def _read(value: Any, update: Any) -> None:
    """Feed everything that tells nested dataclasses and tuples apart to a digest."""
    if isinstance(value, np.ndarray):
        update(f"{value.dtype}{value.shape}".encode())
        update(np.ascontiguousarray(value).data)
        return
    parts = _parts(value)
    update(f"{type(value).__name__}{len(parts)}".encode())
    if not parts:
        update(repr(value).encode())
    for part in parts:
        _read(part, update)


def _parts(value: Any) -> list[Any]:
    """Return what a dataclass or tuple consists of."""
    if is_dataclass(value):
        return [getattr(value, each.name) for each in fields(value)]
    return list(value) if isinstance(value, tuple) else []
