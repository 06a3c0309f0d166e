import numpy as np
import pytest

from studies.usd_files import bench_usd


@pytest.mark.long
def test_every_precision_is_measured_and_files_are_the_arrays_and_little_else():
    results = bench_usd(splats=2000, pictured=500)
    found = {(r.labels["precision"], r.labels["format"]): r.values for r in results}
    for precision, raw in (("float", 236), ("mixed", 124), ("half", 118)):
        for suffix in ("usdc", "usdz"):
            assert 0 < found[precision, suffix]["beyond arrays [B]"] < 4096
            size = found[precision, suffix]["size [MB]"] * 1e6
            assert found[precision, suffix]["np.save [s]"] > 0
            assert found[precision, suffix]["np.load [s]"] > 0
            assert np.isclose(size, 2000 * raw + found[precision, suffix]["beyond arrays [B]"])
    # What is rounded more differs more; floats come back as they were.
    psnr = [found[precision, "usdc"]["PSNR [dB]"] for precision in ("float", "mixed", "half")]
    assert psnr[0] > 100 > psnr[1] > psnr[2] > 45
