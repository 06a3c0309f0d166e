"""Facts about a whole recording: in transforms.json under ``digs_warp``, and in its record the object."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.checks import CaptureError
from digs_warp.data.objects import (
    Matrix,
    PlacedObject,
    is_list_of_objects,
    is_placement,
    matrix_rows,
)
from digs_warp.record.fields import is_number, is_text, shown
from digs_warp.record.run_log import RunRecord


@dataclass(frozen=True, kw_only=True)
class About:
    """Facts about a recording; None if the recorder does not provide one.

    Attributes:
        recorded_as: form of the recording that the capture was converted from.
        poses_known: False: the poses of all frames are the identity and mean nothing.
        poses_in_metres: False: the unit of the poses is arbitrary.
        tier: kind of simulated sensor.
        seed: seed of the simulation.
        object_radius: radius of the simulated object [m].
        world_from_mesh: rotation, scale and translation from the coordinates of the simulated mesh file to
            the world [m], rows of a (4, 4) matrix; None: the built-in object, which is made in the world, or
            several objects.
        objects: of the simulation; the first has number 1 in the images of object numbers.
        surround_radius: radius of its surround [m]; of a room, half its width.
        ground: what the objects stand on: "floor", "table" or "none".
        exposure: factor from radiance to pixel values in the simulation.
        imu: rate [Hz] and noise of the accelerometer and the gyroscope, gravity [m/s^2].
        sensor: parameters of the simulated stereo camera; None for infinite ones.
        readout_time: time from the first row of an image to the last [s]; 0: all rows at once.
        effects: names of the simulated effects of the sensor.
        cause_labels: names of the values in the cause images.
    """

    recorded_as: str | None = None
    poses_known: bool | None = None
    poses_in_metres: bool | None = None
    tier: str | None = None
    seed: int | None = None
    object_radius: float | None = None
    world_from_mesh: Matrix | None = None
    objects: tuple[PlacedObject, ...] | None = None
    surround_radius: float | None = None
    ground: str | None = None
    exposure: float | None = None
    imu: dict[str, Any] | None = None
    sensor: dict[str, Any] | None = None
    readout_time: float | None = None
    effects: tuple[str, ...] | None = None
    cause_labels: dict[int, str] | None = None

    def instance(self, number: int) -> PlacedObject | None:
        """Return the object with a number from 1; None if the recorder names none with it."""
        objects = self.objects or ()
        return objects[number - 1] if 1 <= number <= len(objects) else None

    def as_json(self) -> dict[str, Any]:
        """Return the known facts in the form of transforms.json."""
        facts = {each.name: getattr(self, each.name) for each in fields(self)}
        if self.cause_labels is not None:
            facts["cause_labels"] = {str(code): name for code, name in self.cause_labels.items()}
        if self.objects is not None:
            facts["objects"] = [each.as_json() for each in self.objects]
        return {name: value for name, value in facts.items() if value is not None}


def read_about(facts: dict[str, Any], where: str) -> About:
    """Return the facts that `About.as_json` wrote; keys of other programs are ignored.

    Args:
        facts: the object under ``digs_warp``.
        where: prefix of messages, which names the file.

    Raises:
        CaptureError: a value does not fit its key.
    """
    known: dict[str, Any] = {}
    for name, (fits, expected) in _EXPECTED.items():
        value = facts.get(name)
        if value is None:
            continue
        if not fits(value):
            raise CaptureError(f"{where}: {name} is {shown(value)}, expected {expected}")
        known[name] = value
    if "effects" in known:
        known["effects"] = tuple(known["effects"])
    if "cause_labels" in known:
        known["cause_labels"] = {int(code): name for code, name in known["cause_labels"].items()}
    if "world_from_mesh" in known:
        known["world_from_mesh"] = matrix_rows(np.array(known["world_from_mesh"], np.float64))
    if "objects" in known:
        known["objects"] = tuple(PlacedObject.from_json(each) for each in known["objects"])
    return About(**known)


def _is_positive(value: Any) -> bool:
    return is_number(value) and value >= 0


def _is_list_of_text(value: Any) -> bool:
    return isinstance(value, list) and all(map(is_text, value))


def _are_labels(value: Any) -> bool:
    return isinstance(value, dict) and all(
        code.isdecimal() and len(code) < 4 and is_text(name) for code, name in value.items()
    )


# Key -> whether a value fits, and what is expected.
_EXPECTED: dict[str, tuple[Callable[[Any], bool], str]] = {
    "recorded_as": (is_text, "a name"),
    "poses_known": (lambda value: isinstance(value, bool), "true or false"),
    "poses_in_metres": (lambda value: isinstance(value, bool), "true or false"),
    "tier": (is_text, "a name"),
    "seed": (lambda value: type(value) is int and value >= 0, "an integer, 0 or more"),
    "object_radius": (_is_positive, "metres"),
    "world_from_mesh": (
        is_placement,
        "4 rows of 4 numbers: a rotation, a scale and a translation",
    ),
    "objects": (
        is_list_of_objects,
        "a list of objects with name, size (3 lengths in metres) and world_from_mesh (4 x 4)",
    ),
    "surround_radius": (_is_positive, "metres"),
    "ground": (is_text, "a name"),
    "exposure": (_is_positive, "a number, 0 or more"),
    "imu": (lambda value: isinstance(value, dict), "an object of figures"),
    "sensor": (lambda value: isinstance(value, dict), "an object of figures"),
    "readout_time": (_is_positive, "seconds, 0 for a camera that takes all rows at once"),
    "effects": (_is_list_of_text, "a list of names"),
    "cause_labels": (_are_labels, 'names by number, such as {"0": "ok"}'),
}


@dataclass(frozen=True)
class RecordedObject:
    """The object of a recording.

    Attributes:
        size: along x, y and z of the world [m].
        up: the axis of the mesh file that points up; None: the built-in object, which has no file.
        scale: how the size was found, in words; None: the same.
    """

    size: tuple[float, float, float]
    up: str | None = None
    scale: str | None = None

    @staticmethod
    def find(folder: Path) -> "RecordedObject | None":
        """Return the object of a capture folder; None if its record names none."""
        record = RunRecord.find(folder)
        found = record.results.get("object") if record else None
        if not isinstance(found, dict):
            return None
        return RecordedObject(tuple(found["size"]), found.get("up"), found.get("scale"))
