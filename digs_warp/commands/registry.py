"""The commands, in the order in which the help shows them."""

from collections.abc import Iterator, Mapping
from importlib import import_module

from digs_warp.commands.command import Group, Node


class _Places(Mapping[str, Node]):
    """Commands by name, each imported when it is asked for: one command starts without the others.

    Args:
        places: by name, "module.NAME" in this folder.
    """

    def __init__(self, places: Mapping[str, str]) -> None:
        self._places = places

    def __getitem__(self, name: str) -> Node:
        module, _, kind = self._places[name].partition(".")
        return getattr(import_module(f"digs_warp.commands.{module}"), kind)

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


COMMANDS = Group(
    """Simulate a handheld stereo depth camera, reconstruct what it recorded as
Gaussian splats, and write them as a USD scene.

Start with 'digs-warp run --out out/demo'. It needs no input, takes a few minutes
and ends by saying where the results are.

Every command explains its flags with --help. --quiet shows no progress, --verbose logs
details, --version prints the version.""",
    _Places(
        {
            "run": "run.Run",
            "plan": "plan.Plan",
            "simulate": "simulate.Simulate",
            "check": "check.Check",
            "reconstruct": "reconstruct.Reconstruct",
            "export-usd": "export_usd.ExportUsd",
            "convert": "convert.Convert",
            "view": "view.View",
            "report": "report.Report",
            "render": "render.Render",
            "mesh": "mesh.Mesh",
            "info": "info.Info",
            "usd": "usd_scene.USD",
            "masks": "masks.Masks",
            "sensor": "sensor.SENSOR",
            "bench": "bench.BENCH",
            "study": "study.STUDY",
            "preference": "preference.PREFERENCE",
        }
    ),
)
