import numpy as np
import pytest

from studies.usd_files import bench_usd


@pytest.mark.long
def test_every_precision_is_measured_and_files_are_the_arrays_and_little_else():
    results = bench_usd(splats=2000, pictured=500)
    found = {r.labels["precision"]: r.values for r in results}
    for precision, raw in (("float", 236), ("mixed", 124), ("half", 118)):
        assert np.isclose(found[precision]["size [MB]"], 2e-3 * raw, atol=4e-3)
    # What is rounded more differs more; floats come back as they were.
    psnr = [found[precision]["PSNR [dB]"] for precision in ("float", "mixed", "half")]
    assert psnr[0] > 100 > psnr[1] > psnr[2] > 45
