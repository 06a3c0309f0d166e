"""`digs-warp plan`: which effects a sensor would show on a scene, and why, without recording it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, Self

import tyro

from digs_warp.commands.command import SettingsCommand
from digs_warp.commands.output import JsonFile
from digs_warp.record.files import to_json
from digs_warp.record.typed import from_json
from digs_warp.sim.config import SimulateConfig
from digs_warp.words import counted


@dataclass(frozen=True, kw_only=True)
class _PlanOptions(SimulateConfig):
    """The recording that is planned."""

    tier: Literal["guided", "matcher"] = "guided"
    """Sensor: 'guided' searches near the truth; 'matcher' searches the full range."""


@dataclass(frozen=True, kw_only=True)
class Plan(JsonFile, SettingsCommand):
    """Render a few frames of a scene and list the sensor effects that matter on it, and why."""

    recording: Annotated[_PlanOptions, tyro.conf.OmitArgPrefixes] = field(
        default_factory=_PlanOptions
    )
    recorded_as: ClassVar[str] = "simulate"
    recorded: ClassVar[type] = SimulateConfig
    main_flags: ClassVar[tuple[str, ...]] = (
        *("mesh", "environment", "frames", "profile", "width", "tier", "effects"),
        *("error_strength", "json", "overwrite"),
    )

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any]) -> Self:
        """Return the command with the settings of a capture's run.json."""
        return cls(recording=from_json(_PlanOptions, settings, "settings", strict=True))

    def execute(self) -> str:
        """Measure, choose, and return the choices as tables."""
        from digs_warp.sim.record.inputs import load_inputs
        from digs_warp.sim.record.sensor_plan import check_effects, make_plan
        from digs_warp.sim.record.session import prepare_session
        from digs_warp.sim.sensor.planner import format_plan

        self.check(*self.recording.input_files)
        check_effects(self.recording)
        session = prepare_session(self.recording, load_inputs(self.recording))
        plan = make_plan(session)
        self.write(to_json(plan.as_json()))
        looked = plan.facts.frames if plan.facts else 0
        parts = [f"{session.profile.title}, measured on {counted(looked, 'frame')}"]
        for name, choices in (("On the images", plan.color), ("On depth", plan.depth)):
            if choices:
                on = sum(choice.on for choice in choices)
                parts.append(f"{name}, {on} of {len(choices)} effects:\n{format_plan(choices)}")
        return "\n\n".join(parts)
