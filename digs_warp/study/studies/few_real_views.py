"""Few views of real recordings: a room and a piece of furniture, as they were recorded."""

from collections.abc import Sequence

from digs_warp.init.strategies import STRATEGIES, StrategyName
from digs_warp.study.engine.case import Case
from digs_warp.study.engine.records import Column, Record, group_by, number, tabulate
from digs_warp.study.page import Section
from digs_warp.study.real_recordings import is_there

# Depth and poses were recorded; 29 and 24 frames, half of them held out.
RECORDINGS = ("tum_cabinet_orbit", "hololens_room_sequence")
VIEWS = (3, 6, 12)
# A step on these larger images takes about this many times as long as one on an object's.
EFFORT = 4.0


def cases(
    strategies: Sequence[StrategyName],
    depth_weights: dict[str, float | None],
    random_points: int,
    seed: int,
    iterations: int,
) -> list[Case]:
    """Return the cases of the recordings that the sample data has, none without it.

    Args:
        strategies: of the initialization.
        depth_weights: weight of depth in the loss by the name of the case; None: the default.
        random_points: how many points 'random' draws.
        seed: of the training.
        iterations: of the training.
    """
    return [
        Case(
            labels={
                **{"recording": name, "views": views, "strategy": strategy, "depth loss": loss},
                "seed": seed,
            },
            recording={"real": name, "frames": 2 * views},
            reconstruction={
                **{"test_every": 2, "init.strategy": strategy},
                **({"init.target_points": random_points} if strategy == "random" else {}),
                "train.density.strategy": STRATEGIES[strategy].density,
                "train.depth_weight": weight,
                **{"train.stop.iterations": iterations, "train.seed": seed},
            },
            effort=EFFORT,
        )
        for name in filter(is_there, RECORDINGS)
        for views in VIEWS
        for strategy in strategies
        for loss, weight in depth_weights.items()
        # What depth in the loss is worth for sparse starts, objects show in a quarter of the time.
        if strategy == "highdepth" or weight is None
    ]


def is_real(record: Record) -> bool:
    """Whether a record is that of a real recording."""
    return "real" in record["recording"]


def section(records: Sequence[Record]) -> Section:
    """Return the quality on held-out frames."""
    columns = [
        Column("best along the run [dB]", 2, best_of_course),
        Column("held-out frames [dB]", 2, number("metrics", "psnr_frame")),
        Column("exposure fitted [dB]", 2, number("metrics", "psnr_frame_aligned")),
        Column("to the measured depth [cm]", 2, number("results", "adherence", factor=100)),
        Column("Gaussians", 0, number("results", "gaussians"), deviation=False),
        Column("training [s]", 1, number("seconds", "train")),
    ]
    labels = ("recording", "views", "strategy", "depth loss")
    text = (
        "Recordings that other people made, of a whole scene, with depth and poses as recorded. Of the "
        "frames, evenly spread over the recording, every second one is held out. No perfect camera saw the "
        "scene, so these frames are the only measure: with fewer views they are others, further from the "
        "training views, and only rows with the same number of views compare. Exposure fitted: after "
        "brightness and white balance of each held-out frame were fitted, which these cameras change."
    )
    table = tabulate("real_recordings", labels, group_by(records, *labels), columns)
    return Section("Real recordings", text, [table])


def best_of_course(record: Record) -> float | None:
    """Return the highest PSNR of held-out frames along the training [dB]."""
    return max((v for row in record["course"] if (v := row.get("psnr_frame"))), default=None)
