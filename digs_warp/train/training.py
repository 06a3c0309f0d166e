"""What a training decided and found."""

from dataclasses import dataclass
from typing import Annotated

from digs_warp.init.view_dependence import ViewDependence
from digs_warp.record.results import Figure
from digs_warp.record.typed import NOT_STORED
from digs_warp.train.course import CourseRow
from digs_warp.train.shutter import BlurPlan, ShutterPlan
from digs_warp.train.time_plan import TimePlan


@dataclass(frozen=True, eq=False, kw_only=True)
class Training:
    """The record of a training.

    Attributes:
        course: one row every few iterations, the last one from the end; training.jsonl has them.
        rolling_shutter: whether the training drew it, and why.
        motion_blur: the same.
        view_dependence: the degree of the color that the photographs called for; None: the settings said
            which.
        gaussians: how many there are at the end.
        plan: what was chosen for the time budget, where there is one.
        iterations: steps taken.
        stopped_by: what ended it: "iterations", "target psnr" or "time budget".
        training_seconds: of the steps alone [s].
        exposure_stops: root mean square of the photographs' gains [stops]: how much their exposure and white
            balance vary; 0 where they are known to be constant, None if they were not fitted.
        adherence: median distance of the surface to the measured depth [m]; None where none was measured.
    """

    course: Annotated[tuple[CourseRow, ...], NOT_STORED] = ()
    rolling_shutter: Annotated[ShutterPlan | None, Figure("rolling shutter")] = None
    motion_blur: Annotated[BlurPlan | None, Figure("motion blur")] = None
    view_dependence: Annotated[ViewDependence | None, Figure("view-dependent color")] = None
    gaussians: int | None = None
    plan: Annotated[TimePlan | None, Figure("planned for the time budget")] = None
    iterations: Annotated[int | None, Figure("iterations")] = None
    stopped_by: Annotated[str | None, Figure("training ended by")] = None
    training_seconds: Annotated[float | None, Figure("training", "s", digits=1)] = None
    exposure_stops: Annotated[float | None, Figure("exposure varies by", "stops", digits=3)] = None
    adherence: Annotated[
        float | None, Figure("adherence to the measured depth", "mm", factor=1e3)
    ] = None
