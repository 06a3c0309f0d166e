"""What a run of a case could have measured: records for the tests of what reports make of them."""

from typing import Any

from digs_warp.record.files import plain
from digs_warp.study.engine.case import Case


def record_of(case: Case, number: int) -> dict[str, Any]:
    """What a run of ``case`` could have measured."""
    psnr = 25.0 + number % 7

    def scores(dB: float) -> dict[str, float]:
        return {"psnr_object": dB, "ssim_object": 0.9, "psnr_frame": dB, "ssim_frame": 0.9}

    return {
        "key": case.key,
        "labels": dict(case.labels),
        "recording": plain(case.recording),
        "reconstruction": plain(case.reconstruction),
        "threads": 2,
        "metrics": scores(psnr),
        "course": [
            {"iteration": i, "seconds": i / 50} | scores(psnr - 500 / i)
            for i in (100, 300, 500, 1000)
        ],
        "yardstick": {"psnr_object": psnr - 1, "psnr_object_in_place": psnr - 1}
        | {"psnr_frame": psnr + 5},
        "surface": {"points": {"chamfer": 0.004, "recall": 0.8}},
        "seconds": {"initialize": 1.0, "train": 10.0 + number, "compile kernels": 99.0},
        "machine": "2 cores of a test",
        "recording_seconds": {"render": 15.0, "sense": 5.0},
        "results": {"initial_points": 1000 + number, "gaussians": 900},
    }
