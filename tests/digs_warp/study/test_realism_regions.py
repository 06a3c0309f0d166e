"""The benchmark sees how many pixels try two blocks, and that they find what they find with four."""

from digs_warp.study.realism_regions import region_results
from digs_warp.study.realism_scenes import Place


def test_regions_of_the_built_in_scene() -> None:
    scene = Place(None, None, tuned=False).scene(480)
    (result,) = region_results(scene, 480)
    assert result.labels["scene"] == "built-in"
    assert result.values["two blocks"] > 0.1
    assert result.values["differ there"] < 0.001 and result.values["elsewhere"] < 0.005
