"""The verdict says whether a result is good, why, and what to do; nothing in it contradicts another."""

import re

import numpy as np
import pytest

from digs_warp.data.about import About
from digs_warp.data.frame import Frame
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.layers import Layer
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.measure.scores import Score, Scores
from digs_warp.pipeline.records import Poses, Verdict
from digs_warp.pipeline.verdict import PROJECTOR, _nearness, likeness, verdict

SIDE, SIZE = 160, 0.2  # px, m
K = Intrinsics(SIDE, SIDE, 200.0, 200.0, SIDE / 2, SIDE / 2)
SCORES = Scores(mean=Score(psnr_object=30.0, psnr_object_aligned=30.2))


def frames(depth_share: float, noise: float, plain: bool, side: int = 100) -> tuple[Frame, ...]:
    """A wall 1 m away before a camera that moves sideways; the object is its middle."""
    rng = np.random.default_rng(0)
    mask = np.zeros((SIDE, SIDE), np.uint8)
    first = (SIDE - side) // 2
    mask[first : first + side, first : first + side] = 255
    shown = np.full((SIDE, SIDE, 3), 120, np.uint8)
    if not plain:
        shown = rng.integers(0, 256, shown.shape, np.uint8)
    found = []
    for number in range(6):
        depth = (1 + noise * rng.standard_normal((SIDE, SIDE))).astype(np.float32)
        depth[rng.random((SIDE, SIDE)) > depth_share] = np.nan
        pose = np.eye(4)
        pose[0, 3] = 0.01 * number
        layers = {Layer.IMAGE: shown, Layer.DEPTH: depth, Layer.MASK: mask}
        found.append(Frame(str(number), Camera(K, pose), float(number), layers))
    return tuple(found)


def judged(
    seen: tuple[Frame, ...], scores: Scores = SCORES, about: About | None = None, **poses: tuple
) -> Verdict:
    ends = SIZE * (np.random.default_rng(0).random((500, 3)) - 0.5)
    count = np.zeros((500, 1), np.float32)
    gaussians = Gaussians(
        means=ends.astype(np.float32),
        log_scales=np.repeat(count, 3, axis=1),
        quats=np.repeat(count + 1, 4, axis=1),
        opacity_logits=count[:, 0],
        sh=np.zeros((500, 1, 3), np.float32),
    )
    record = Poses(frames=PosedFrames(seen, ()), **poses)  # pyright: ignore
    return verdict(record, scores, 0.002, gaussians, about or About(), None)


def test_a_good_result_is_called_good_by_what_was_measured() -> None:
    found = judged(frames(0.95, 0.001, plain=False))
    assert found.good and not found.advice
    assert found.because[0] == "depth on 95% of the object"
    near = r"((nearly )?as near to|[\d.]+ times as far from) the measured depth as neighboring views agree"
    words = f"good: {near}"
    assert re.fullmatch(f"{words}; held-out views are close to the photographs", found.words)


def test_what_is_not_known_is_not_said() -> None:
    assert ";" not in judged(frames(0.95, 0.001, plain=False), Scores()).words
    assert likeness(float("nan"), "object") == ("", "")
    assert [_nearness(each, 1.0, "a", "b") for each in (0.9, 1.4, 2.0)] == [
        *("as near to a as b", "nearly as near to a as b", "2.0 times as far from a as b")
    ]
    assert likeness(26.0, "object")[0] == "fair" and likeness(26.0, "scene")[0] == "good"


def test_a_projector_is_not_suggested_to_who_has_one() -> None:
    about = About(sensor={"projector_power": 0.2})
    assert PROJECTOR not in judged(frames(0.35, 0.001, plain=True), about=about).advice


POOR = {
    "holes": (frames(0.35, 0.001, True), {}, "depth covers 35% of the object", PROJECTOR),
    "noise": (frames(0.95, 0.05, False), {}, "neighboring views differs by", "nearer"),
    "few pixels": (frames(0.95, 0.001, False, 30), {}, "only 30 px wide", "more pixels"),
    "errors": (
        frames(0.95, 0.001, False),
        {"errors": ("order",)},
        "contradicts",
        "digs-warp check",
    ),
}


@pytest.mark.parametrize("name", POOR)
def test_a_poor_result_says_why_and_what_to_do(name: str) -> None:
    seen, poses, because, advice = POOR[name]
    found = judged(seen, **poses)
    assert not found.good and found.words.startswith("poor, because ")
    assert because in found.words and advice in found.words.split("To do: ")[1]
    assert len(set(found.advice)) == len(found.advice) and "fewer" not in found.words
