"""Save and restore a training run: parameters, moments, step and time, in one ``.npz``.

The order of views and the backgrounds follow from (seed, step) alone, so this is all the state there is:
a resumed run continues bit for bit.
"""

from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import BadZipFile

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.gaussians import FIELDS
from digs_warp.log import write_arrays

if TYPE_CHECKING:
    from digs_warp.train.trainer import Trainer


def save_checkpoint(path: Path, trainer: "Trainer") -> None:
    """Write the state of a run; the file appears only when complete."""
    adam = trainer.optimizer
    state = {"step": np.array(adam.step), "seconds": np.array(trainer.seconds)}
    groups = {"value": trainer.gaussians, "first": adam.moments_1, "second": adam.moments_2}
    for group, arrays in groups.items():
        for name, array in zip(FIELDS, arrays.arrays, strict=True):
            state[f"{group}_{name}"] = array.numpy()
    write_arrays(path, state)


def load_checkpoint(path: Path, trainer: "Trainer") -> None:
    """Continue the run saved in ``path``.

    Raises:
        DigsError: the file is broken, or belongs to a run with other Gaussians.
    """
    adam = trainer.optimizer
    groups = {"value": trainer.gaussians, "first": adam.moments_1, "second": adam.moments_2}
    try:
        with np.load(path, allow_pickle=False) as state:
            loaded = {name: state[name] for name in state.files}
        for group, arrays in groups.items():
            for name, array in zip(FIELDS, arrays.arrays, strict=True):
                saved = loaded[f"{group}_{name}"]
                if saved.shape != array.numpy().shape:
                    raise DigsError(
                        f"checkpoint '{path}': {name} of shape {saved.shape}, expected "
                        f"{array.numpy().shape}; it belongs to another run. Start with --overwrite."
                    )
                array.assign(saved)
        adam.step = int(loaded["step"])
        trainer.seconds = float(loaded["seconds"])
    except (BadZipFile, KeyError, EOFError, OSError) as error:
        raise DigsError(
            f"checkpoint '{path}': cannot be read ({error}); delete it to train from the start"
        ) from error
