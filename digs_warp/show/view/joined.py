"""Several sets of Gaussians as one."""

from collections.abc import Sequence

import numpy as np

from digs_warp.data.gaussians import FIELDS, Gaussians


def joined(sets: Sequence[Gaussians]) -> Gaussians:
    """Return all Gaussians of one or more sets; lower degrees of the color are filled up with zeros."""
    bands = max(each.sh.shape[1] for each in sets)
    columns = {name: np.concatenate([getattr(each, name) for each in sets]) for name in FIELDS[:-1]}
    sh = [np.pad(each.sh, ((0, 0), (0, bands - each.sh.shape[1]), (0, 0))) for each in sets]
    return Gaussians(**columns, sh=np.concatenate(sh))
