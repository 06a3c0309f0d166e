"""The page of `digs-warp view`: the viewer of the report, with switches for what it shows."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from digs_warp.show.report.markup import html_page
from digs_warp.show.report.view3d.section import BUTTONS, HELP, LEGEND, cameras_of, data, script
from digs_warp.show.view.contents import GAUSSIANS, Contents
from digs_warp.show.view.layers import pictures_of

# Everything is asked of the server of the page.
_ALLOWED = "default-src 'self'; img-src 'self' data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"

_CSS = """
#view3d { margin: 0; border: 0; border-radius: 0; height: 100vh; display: grid;
  grid-template: 1fr auto / 1fr 19rem; gap: 0 .75rem; }
#view3d .stage { min-height: 0; }
#view3d canvas, #view3d:fullscreen canvas { height: 100%; }
#view3d .panel { grid-row: 1 / 3; grid-column: 2; overflow-y: auto; }
#view3d .panel > label, #view3d .panel p { display: flex; justify-content: space-between; margin: .3rem 0; }
#view3d .panel p { display: block; font-size: .85rem; }
#view3d .panel h2 { font-size: 1rem; }
#view3d .panel input[type=number] { width: 5rem; } #view3d .panel input[type=text] { width: 100%; }
#view3d .photo { position: absolute; left: .5rem; bottom: .5rem; width: 30%; cursor: pointer; }
#view3d .photo.over { inset: 0; width: 100%; height: 100%; object-fit: contain; background: none; }
#view3d .photo[hidden] { display: none; }
@media (max-width: 50rem) { #view3d { grid-template: 60vh auto 1fr / 1fr; height: auto; }
  #view3d .panel { grid-row: 3; grid-column: 1; } }
"""


def page_of(contents: Sequence[Contents], layers: Sequence[Mapping[str, int]]) -> str:
    """Return the page.

    Args:
        contents: what it shows; several stand side by side.
        layers: of each, what can be shown and hidden, and how many stages it has.
    """
    about = {
        "help": HELP,
        "contents": [_about(n, *pair) for n, pair in enumerate(zip(contents, layers, strict=True))],
    }
    body = (
        f"<section id=view3d><div class=stage><canvas tabindex=0 aria-label='{HELP}'></canvas>"
        "<img class=photo alt='what the camera saw' hidden></div><div class=panel></div>"
        f"<div><div class=tools>{BUTTONS}</div>{LEGEND}<p class=note role=status></p></div></section>\n"
        f"{data('view3d-about', 'application/json', json.dumps(about))}{script('view')}"
    )
    return html_page("digs-warp view", _ALLOWED, body, _CSS)


def _about(number: int, content: Contents, layers: Mapping[str, int]) -> dict[str, Any]:
    """Return what the viewer has to know of a content."""
    first = content.first_view()
    by_time = [(frame, frame.name in content.held_out) for frame in content.frames]
    subject = content.subject
    reach = [[float(c + sign * subject.radius) for c in subject.center_world] for sign in (-1, 1)]
    labels = [stage.label for stage in content.stages]
    return {
        "name": content.name,
        "facts": content.facts,
        "start": first.to_json(),
        "box": reach,
        "cameras": cameras_of(first, by_time) if by_time else None,
        "pictures": pictures_of(content.frames),
        "layers": [
            {
                "name": name,
                # Points and meshes would cover the Gaussians.
                "shown": name == GAUSSIANS or not content.stages,
                "stages": [
                    {
                        "label": labels[k] if name == GAUSSIANS else "",
                        "url": f"splats/{number}/{name}/{k}",
                    }
                    for k in range(count)
                ],
            }
            for name, count in layers.items()
        ],
    }
