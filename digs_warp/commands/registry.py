"""The list of commands, in the order in which the help shows them."""

from typing import ClassVar, Protocol

from digs_warp.commands.bench import Bench
from digs_warp.commands.convert import Convert
from digs_warp.commands.export_usd import ExportUsd
from digs_warp.commands.info import Info
from digs_warp.commands.mesh import Mesh
from digs_warp.commands.plan import Plan
from digs_warp.commands.preference import Preference
from digs_warp.commands.recommend import Recommend
from digs_warp.commands.reconstruct import Reconstruct
from digs_warp.commands.render import Render
from digs_warp.commands.run import Run
from digs_warp.commands.simulate import Simulate
from digs_warp.commands.study import StudyCommand
from digs_warp.commands.usd_scene import Usd


class Command(Protocol):
    """What the command line needs of a command."""

    can_resume: ClassVar[bool]

    def execute(self) -> str:
        """Do the work and return what to print at the end."""
        ...


COMMANDS: dict[str, type[Command]] = {
    "run": Run,
    "plan": Plan,
    "simulate": Simulate,
    "reconstruct": Reconstruct,
    "export-usd": ExportUsd,
    "convert": Convert,
    "render": Render,
    "mesh": Mesh,
    "info": Info,
    "usd": Usd,
    "bench": Bench,
    "study": StudyCommand,
    "recommend": Recommend,
    "preference": Preference,
}
