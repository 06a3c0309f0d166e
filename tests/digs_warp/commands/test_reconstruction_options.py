"""The flags of the reconstruction: every error names the flag as it is typed."""

import pytest

from digs_warp.cli import EXIT_WRONG_USAGE, main

BAD: dict[str, str] = {
    # Recording
    **{"--frames": "0", "--width": "0", "--height": "-5", "--samples-per-pixel": "0"},
    **{"--seed": "-1", "--strength": "nan", "--object-size": "0"},
    # Poses and masks
    **{"--feature-size": "31", "--features": "49", "--overlap": "0", "--loop-images": "-1"},
    **{"--readout-time": "0.5", "--min-registered": "0", "--rotation-error-deg": "-1"},
    **{"--translation-error": "inf", "--mask-error": "11"},
    # Initialization
    **{"--voxel-size": "0", "--disparity-noise": "0", "--target-points": "0", "--max-points": "0"},
    **{
        "--background-weight": "0.5",
        "--min-support": "1.5",
        "--opacity": "1",
        "--splat-width": "0",
    },
    **{"--mask-threshold": "255"},
    # Training
    **{"--iterations": "-1", "--time-budget": "never", "--target-psnr": "0", "--sh-degree": "4"},
    **{"--means-rate": "0", "--scales-rate": "0", "--quats-rate": "0", "--opacities-rate": "0"},
    **{"--colors-rate": "nan", "--rates-end": "0", "--max-splats": "0", "--splat-memory": "0"},
    **{"--dssim-weight": "2", "--coverage-weight": "-1", "--depth-weight": "-1"},
    **{"--opacity-weight": "-1", "--scale-weight": "-1", "--half-size-until": "1.5"},
    **{"--image-memory": "0"},
}


@pytest.mark.parametrize("flag", BAD)
def test_a_value_out_of_range_is_refused_with_its_flag(
    flag: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "--out", "x", flag, BAD[flag]]) == EXIT_WRONG_USAGE
    message = " ".join(capsys.readouterr().err.replace("\u2502", " ").split())
    assert f"{flag}: " in message and "expected" in message
