"""The commands, in the order in which the help shows them."""

from digs_warp.commands.bench import BENCH
from digs_warp.commands.check import Check
from digs_warp.commands.command import Group
from digs_warp.commands.convert import Convert
from digs_warp.commands.export_usd import ExportUsd
from digs_warp.commands.info import Info
from digs_warp.commands.masks import Masks
from digs_warp.commands.mesh import Mesh
from digs_warp.commands.plan import Plan
from digs_warp.commands.preference import PREFERENCE
from digs_warp.commands.recommend import Recommend
from digs_warp.commands.reconstruct import Reconstruct
from digs_warp.commands.render import Render
from digs_warp.commands.report import Report
from digs_warp.commands.run import Run
from digs_warp.commands.sensor import SENSOR
from digs_warp.commands.simulate import Simulate
from digs_warp.commands.study import STUDY
from digs_warp.commands.usd_scene import USD
from digs_warp.commands.view import View

COMMANDS = Group(
    """Simulate a handheld stereo depth camera, reconstruct what it recorded as
Gaussian splats, and write them as a USD scene.

Start with 'digs-warp run --out out/demo'. It needs no input, takes a few minutes
and ends by saying where the results are.

Every command explains its flags with --help. --quiet shows no progress, --verbose logs
details, --version prints the version.""",
    {
        "run": Run,
        "plan": Plan,
        "simulate": Simulate,
        "check": Check,
        "reconstruct": Reconstruct,
        "export-usd": ExportUsd,
        "convert": Convert,
        "view": View,
        "report": Report,
        "render": Render,
        "mesh": Mesh,
        "info": Info,
        "usd": USD,
        "masks": Masks,
        "sensor": SENSOR,
        "bench": BENCH,
        "study": STUDY,
        "recommend": Recommend,
        "preference": PREFERENCE,
    },
)
