"""Every strategy of the table can be initialized, and its row decides the defaults."""

from typing import get_args

import pytest

from digs_warp.init.config import InitConfig
from digs_warp.init.strategies import STRATEGIES, StrategyName, VoxelUnit


def test_every_name_has_a_row() -> None:
    assert set(STRATEGIES) == set(get_args(StrategyName))


@pytest.mark.parametrize("name", STRATEGIES)
def test_the_row_decides_the_defaults(name: StrategyName) -> None:
    row = STRATEGIES[name]
    config = InitConfig(strategy=name)
    assert (config.seed_opacity, config.seed_width) == (row.opacity, row.width)
    # In metres the default follows the recording.
    assert set(row.voxel_sizes) == set(get_args(VoxelUnit)) - {"metre"}
    assert (config.voxel_edge, config.voxel_pixels) == (None, row.voxel_pixels)
    for unit, size in row.voxel_sizes.items():
        assert InitConfig(strategy=name, voxel_unit=unit).voxel_edge == size
    given = InitConfig(strategy=name, opacity=0.3, splat_width=2.0, voxel_size=0.5)
    assert (given.seed_opacity, given.seed_width, given.voxel_edge) == (0.3, 2.0, 0.5)
