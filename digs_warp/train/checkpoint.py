"""Save and restore a training run in one ``.npz``: parameters, moments, counters, and the strategy's sums.

The order of views, the backgrounds and every random draw follow from (seed, step), so nothing else has to
be saved: a resumed run continues bit for bit.
"""

import json
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import FIELDS, Gaussians
from digs_warp.record.arrays import UNREADABLE, check_archive, write_arrays
from digs_warp.train.finite import non_finite_rows
from digs_warp.train.trainer import Trainer

_CONTROL = "control_"


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
    for name, array in trainer.control.state().items():
        state[_CONTROL + name] = array
    write_arrays(path, state)
    return True


def checkpoint_step(path: Path) -> int:
    """Return how many steps the run saved in ``path`` has taken; 0 when the file does not exist.

    Raises:
        DigsError: the file is broken.
    """
    return int(_read(path)["step"]) if path.is_file() else 0


def load_checkpoint(path: Path, trainer: Trainer) -> None:
    """Continue the run saved in ``path``.

    Raises:
        DigsError: the file is broken, or belongs to another run.
    """
    saved = _read(path)
    try:
        before, now = json.loads(str(saved["identity"])), trainer.identity()
        different = [name for name, value in now.items() if before.get(name) != value]
        if different:
            raise DigsError(
                f"checkpoint '{path}': {', '.join(different)} differ: it belongs to another run. "
                "Start with --overwrite."
            )
        value, first, second = (
            Gaussians(*(saved[f"{group}_{name}"] for name in FIELDS))
            for group in ("value", "first", "second")
        )
        control = {
            name.removeprefix(_CONTROL): array
            for name, array in saved.items()
            if name.startswith(_CONTROL)
        }
        trainer.control.restore(control)
        trainer.restore(value, (first, second), int(saved["step"]))
        trainer.seconds = float(saved["seconds"])
    except (KeyError, json.JSONDecodeError) as error:
        raise _unreadable(path, error) from error


def _read(path: Path) -> dict[str, np.ndarray]:
    check_archive(path, "checkpoint", "delete it to train from the start")
    try:
        with np.load(path, allow_pickle=False) as state:
            return {name: state[name] for name in state.files}
    except UNREADABLE as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: Exception) -> DigsError:
    return DigsError(
        f"checkpoint '{path}': cannot be read ({error}); delete it to train from the start"
    )
