"""`digs-warp view`: look at files and folders in the browser."""

import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command, SplatOptions
from digs_warp.settings import Range


@dataclass(frozen=True, kw_only=True)
class View(Command):
    """Look at captures, reconstructions and Gaussians in the browser.

    Opens a page and serves it until Ctrl-C: Gaussians along the training, cameras with their pictures,
    measured depth, the start. The page can show depth and normals, and crop.
    """

    paths: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PATH...")]
    """Captures, folders of 'digs-warp reconstruct' or 'run', or Gaussians (.npz, .ply, .spz, .splat, .sog,
    .glb, USD). Several stand side by side."""

    host: str = "127.0.0.1"
    """The address to listen on. 0.0.0.0 lets everyone in the network look; there is no password."""

    port: Annotated[int, Range(1, 65_535)] = 8080
    """The port of the page; if it is taken, the next free one."""

    browser: bool = True
    """Open the page in the browser of this machine; its address is printed in any case."""

    scene: Annotated[SplatOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SplatOptions)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.paths:
            raise DigsError("view: no PATH; name a capture, a reconstruction or Gaussians")

    def execute(self) -> str:
        """Read, serve, and end with Ctrl-C."""
        from digs_warp.show.view.contents import read_contents
        from digs_warp.show.view.server import open_in_browser, started

        contents = [read_contents(path, self.scene.read) for path in self.paths]
        try:
            with started(contents, self.host, self.port) as address:
                sys.stdout.write(f"{address}  (Ctrl-C ends it)\n")
                sys.stdout.flush()
                if self.browser:
                    open_in_browser(address)
                threading.Event().wait()
        except KeyboardInterrupt:
            pass  # the usual end
        return "closed"
