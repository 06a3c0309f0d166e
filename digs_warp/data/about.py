"""Facts about a whole recording: in transforms.json under ``digs_warp``, and in its record the object."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from digs_warp.data.objects import PLACEMENT, Matrix, PlacedObject
from digs_warp.record.run_log import RunRecord
from digs_warp.record.typed import AT_LEAST_0, Expect


def _is_positive(value: float) -> bool:
    return value >= 0


NAME = Expect("a name")
LENGTH = Expect("metres", _is_positive)
FIGURES = Expect("an object of figures")
READOUT = Expect("seconds, 0 for a camera that takes all rows at once", _is_positive)
LABELS = Expect('names by number, such as {"0": "ok"}')
PLACE = Expect("three lengths in metres")
OBJECTS = Expect(
    "a list of objects with name, size (3 lengths in metres) and world_from_mesh (4 x 4)", bool
)


@dataclass(frozen=True, kw_only=True)
class About:
    """Facts about a recording; None if the recorder does not provide one.

    Attributes:
        recorded_as: form of the recording that the capture was converted from.
        poses_known: False: the poses of all frames are the identity and mean nothing.
        poses_in_metres: False: the unit of the poses is arbitrary.
        world_offset: what was taken off all places of the recording, which were too far from the origin for
            float32 [m]; None: nothing.
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
        sensor: parameters of the simulated stereo camera; None for infinite ones.
        readout_time: time from the first row of an image to the last [s]; 0: all rows at once.
        effects: names of the simulated effects of the sensor.
        cause_labels: names of the values in the cause images.
    """

    recorded_as: Annotated[str | None, NAME] = None
    poses_known: bool | None = None
    poses_in_metres: bool | None = None
    world_offset: Annotated[tuple[float, float, float] | None, PLACE] = None
    tier: Annotated[str | None, NAME] = None
    seed: Annotated[int | None, Expect("an integer, 0 or more", _is_positive)] = None
    object_radius: Annotated[float | None, LENGTH] = None
    world_from_mesh: Annotated[Matrix | None, PLACEMENT] = None
    objects: Annotated[tuple[PlacedObject, ...] | None, OBJECTS] = None
    surround_radius: Annotated[float | None, LENGTH] = None
    ground: Annotated[str | None, NAME] = None
    exposure: Annotated[float | None, AT_LEAST_0] = None
    sensor: Annotated[dict[str, Any] | None, FIGURES] = None
    readout_time: Annotated[float | None, READOUT] = None
    effects: Annotated[tuple[str, ...] | None, Expect("a list of names")] = None
    cause_labels: Annotated[dict[int, str] | None, LABELS] = None

    def instance(self, number: int) -> PlacedObject | None:
        """Return the object with a number from 1; None if the recorder names none with it."""
        objects = self.objects or ()
        return objects[number - 1] if 1 <= number <= len(objects) else None


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
