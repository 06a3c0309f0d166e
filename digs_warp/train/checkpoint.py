"""Save and restore a training run in one ``.npz``: parameters, moments, counters, and the strategy's sums.

The order of views, the backgrounds and every random draw follow from (seed, step), so nothing else has to
be saved: a resumed run continues bit for bit.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

import numpy as np

from digs_warp.checks import DigsError, check_finite, check_shape
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.record.arrays import UNREADABLE, check_archive, write_arrays
from digs_warp.record.fields import Fields, parse_json
from digs_warp.train.optimizer import non_finite_rows
from digs_warp.train.trainer import Trainer

# Arrays of these have one row for each Gaussian.
_CONTROL, _SMOOTHING = "control_", "smoothing_"


class _Part(Protocol):
    """What a run keeps beside the Gaussians and their moments."""

    def state(self) -> dict[str, np.ndarray]: ...
    def restore(self, state: dict[str, np.ndarray]) -> None: ...


def _parts(trainer: Trainer) -> dict[str, _Part]:
    """Return the parts of a run, by the prefix of their arrays."""
    parts = {
        _CONTROL: trainer.control,
        _SMOOTHING: trainer.smoothing,
        "exposure_": trainer.exposures,
        "depth_": trainer.depth_judge,
        "poses_": trainer.poses,
    }
    return {prefix: part for prefix, part in parts.items() if part is not None}


def save_checkpoint(path: Path, trainer: Trainer) -> bool:
    """Write the state of a run; the file appears only when complete.

    Returns:
        Whether it was written. A state with non-finite values is not written; the last good one is kept.
    """
    adam = trainer.optimizer
    state = {
        "step": np.array(adam.step),
        "seconds": np.array(trainer.seconds),
        "identity": np.array(json.dumps(trainer.identity())),
    }
    groups = {"value": trainer.gaussians, "first": adam.moments_1, "second": adam.moments_2}
    for group, arrays in groups.items():
        for name, array in zip(FIELDS, arrays.arrays, strict=True):
            state[f"{group}_{name}"] = array.numpy()
    if any(len(non_finite_rows(state[f"value_{name}"])) for name in FIELDS):
        return False
    for prefix, part in _parts(trainer).items():
        state |= {prefix + name: array for name, array in part.state().items()}
    write_arrays(path, state)
    return True


def checkpoint_step(path: Path) -> int:
    """Return how many steps the run saved in ``path`` has taken; 0 when the file does not exist.

    Raises:
        DigsError: the file is broken.
    """
    if not path.is_file():
        return 0
    saved = _read(path)
    with _named(path):
        return int(saved["step"])


def load_checkpoint(path: Path, trainer: Trainer) -> None:
    """Continue the run saved in ``path``.

    Raises:
        DigsError: the file is broken, or belongs to another run.
    """
    saved = _read(path)
    with _named(path):
        before = Fields.of(parse_json(str(saved["identity"])), "identity").values
    different = [name for name, value in trainer.identity().items() if before.get(name) != value]
    if different:
        raise DigsError(
            f"checkpoint '{path}': {', '.join(different)} differ: it belongs to another run. "
            "Start with --overwrite."
        )
    with _named(path):
        groups = [_group(saved, group) for group in ("value", "first", "second")]
        parts = _parts(trainer)
        states = {prefix: _state(saved, prefix, part) for prefix, part in parts.items()}
        for prefix, part in parts.items():
            if prefix != _SMOOTHING:
                part.restore(states[prefix])
        step, seconds = int(saved["step"]), float(saved["seconds"])
    trainer.restore(groups[0], (groups[1], groups[2]), states[_SMOOTHING], step)
    trainer.seconds = seconds


def _group(saved: dict[str, np.ndarray], group: str) -> Gaussians:
    """Return parameters or moments; all are finite, and there are as many moments as parameters."""
    found = Gaussians(*(saved[f"{group}_{name}"] for name in FIELDS))
    for name in FIELDS:
        array = check_finite(f"{group}_{name}", getattr(found, name))
        check_shape(f"{group}_{name}", array, saved[f"value_{name}"].shape)
    return found


def _state(saved: dict[str, np.ndarray], prefix: str, part: _Part) -> dict[str, np.ndarray]:
    """Return the arrays of a part; all are finite."""
    now, count = part.state(), len(saved["value_means"])
    found = {name: check_finite(name, saved[prefix + name]) for name in now}
    if prefix in (_CONTROL, _SMOOTHING):
        for name, array in found.items():
            check_shape(name, array, (count, *now[name].shape[1:]))
    return found


def _read(path: Path) -> dict[str, np.ndarray]:
    check_archive(path, "checkpoint", "delete it to train from the start")
    with _named(path), np.load(path, allow_pickle=False) as state:
        return {name: state[name] for name in state.files}


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Turn what a damaged file causes into an error that names it."""
    try:
        yield
    except UNREADABLE as error:
        raise DigsError(
            f"checkpoint '{path}': cannot be read ({error}); delete it to train from the start"
        ) from error
