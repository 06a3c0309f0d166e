"""Puts the report together."""

from html import escape
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.pipeline.verdict import COARSE, likeness
from digs_warp.record import layout
from digs_warp.record.files import write_atomically
from digs_warp.show.report.capture_section import capture_section
from digs_warp.show.report.course_section import course_section
from digs_warp.show.report.markup import card, html_page, number, part
from digs_warp.show.report.run_section import (
    RunRecords,
    figures_section,
    settings_section,
    times_section,
)
from digs_warp.show.report.view3d.section import script, view_section
from digs_warp.show.report.views_section import views_section
from digs_warp.words import counted

# The page needs nothing from elsewhere, and browsers refuse it should text from a file ask for it.
_ALLOWED = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
)

_CONTENTS = {
    "view3d": "In 3D",
    "views": "Held-out views",
    "training": "Training",
    "recording": "Recording",
    "figures": "All figures",
    "times": "Times",
    "settings": "The same again",
    "words": "Words",
}

# What docs/glossary.md says of the figures, in short.
WORDS = {
    "psnr": (
        "Likeness (PSNR, in dB)",
        "how close drawings of held-out views are to their photographs, which the training never saw: "
        "25 is fair, 30 good, 35 hard to tell apart; 5 less for whole scenes.",
    ),
    "ssim": (
        "SSIM",
        "likeness of structure over the same pixels, 1: identical; above 0.9 is good.",
    ),
    "accuracy": (
        "Accuracy",
        "mean distance of the drawn surface to the true one, which simulated recordings know. Below the "
        "error of the camera's depth is good.",
    ),
    "completeness": ("Completeness", "mean distance of the true surface to the drawn one."),
    "adherence": (
        "Adherence",
        "median distance of the surface to the measured depth; the noise of the camera is in it.",
    ),
    "distances": (
        "Other distances",
        "how likeness changes where the views are drawn from nearer or farther than the photographs, with "
        "exposure fitted: several dB less, and the splats erode from nearby, or swell from afar.",
    ),
    "gaussians": (
        "Gaussians",
        "soft ellipsoids that make up the scene, a few thousand to 200,000. Gloss: how much their color may "
        "change with the direction, degree 0 to 3.",
    ),
    "time": ("Time", "wall-clock seconds of all stages."),
}

# What a run leaves beside the report.
_FILES = {
    layout.SCENE: "the scene for USD programs",
    layout.SPLATS: "the Gaussians as PLY, for viewers of splats",
}


def write_report(capture: Capture, result: Reconstruction, path: Path) -> None:
    """Write the report of a reconstruction as one self-contained HTML file.

    Stage times and settings come from the run.json of the capture, of the reconstruction, and of the folder
    that the report is written to, if it has one.

    Raises:
        DigsError: the recording or the reconstruction is only in memory, the renders are missing, or the
            reconstruction belongs to another capture.
    """
    path = Path(path)
    for what, folder in (("recording", capture.stored_in), ("reconstruction", result.folder)):
        if folder is None:
            command = "simulate" if what == "recording" else "reconstruct"
            raise DigsError(
                f"report '{path}': the {what} is only in memory, and a report reads its files; call "
                f"{command}(..., out=FOLDER)"
            )
    records = RunRecords.find(capture, result, path)
    body = f"<main>\n{_body(capture, result, records, path)}\n</main>"
    page = html_page(f"{_subject(capture, records)} · digs-warp report", _ALLOWED, body)
    write_atomically(path, page.encode("utf-8", "backslashreplace"))


def _body(capture: Capture, result: Reconstruction, records: RunRecords, path: Path) -> str:
    """Return all sections; those of the Gaussians only where there are some to show."""
    posed = result.frames or PosedFrames.as_recorded(capture)
    some = bool(len(result.gaussians))
    name = escape(_subject(capture, records))
    bar = "".join(f'<a href="#{at}">{title}</a>' for at, title in _CONTENTS.items())
    return "\n".join(
        [
            f"<header><h1>{name}</h1>{_verdict(result)}</header><nav>{bar}</nav>",
            view_section(result, posed) if some else "",
            f"{_tiles(result, records)}{_links(path.parent)}",
            views_section(capture, result),
            course_section(result),
            capture_section(capture, result.poses.findings),
            figures_section(result),
            times_section(records),
            settings_section(records),
            _glossary(),
            script(*(["report"] if some else [])),
        ]
    )


def _subject(capture: Capture, records: RunRecords) -> str:
    """Return what was captured: the mesh if the capture names it, else the folder's name."""
    settings = records.capture.settings if records.capture else {}
    if settings.get("scene"):
        return ", ".join(Path(name).stem for name in settings["scene"])
    if "mesh" in settings:
        return Path(settings["mesh"]).stem if settings["mesh"] else "Built-in object"
    return capture.folder.resolve().name


def _likeness_card(result: Reconstruction) -> str:
    mean, is_object = result.scores.mean, result.poses.subject == "object"
    psnr = mean.psnr_object if is_object else mean.psnr_frame
    word = likeness(psnr, result.poses.subject)[0]
    where = "on the object" if is_object else "of everything in view"
    kind = "good" if word != COARSE else "" if result.verdict.good else "poor"
    note = f"held-out views, {where}"
    return card("Likeness (PSNR)", number(psnr, 2, "dB"), word, note, "psnr", kind)


def _surface_card(result: Reconstruction) -> str:
    """Return how far the surface is from the true one, or else from the measured depth."""
    surface, adherence = result.scores.surface, result.training.adherence
    measured = result.verdict.measured
    if surface is not None:
        value, usual, name = surface.accuracy, measured.off, "accuracy"
        note = "mean distance to the true surface"
    else:
        value, usual, name = adherence, measured.apart, "adherence"
        note = "median distance to the measured depth"
    shown = None if value is None else 1e3 * value
    word = kind = ""
    if value is not None and usual:
        word = "as good as the camera" if value <= usual else f"{value / usual:.1f} x the camera's"
        kind = "good" if value <= usual else ""
    return card(f"Surface ({name})", number(shown, 2, "mm"), word, note, name, kind)


def _tiles(result: Reconstruction, records: RunRecords) -> str:
    last = result.course[-1] if result.course else None
    points = len(result.start.points) if result.start else None
    degree = result.gaussians.sh_degree
    gloss = f"gloss of degree {degree}" if degree else "no gloss"
    trained = f"training {number(last.seconds if last else None, 1, 's')} of them"
    cards = [
        _likeness_card(result),
        _surface_card(result),
        card(
            *("Gaussians", f"{len(result.gaussians):,}", gloss),
            *(f"from {number(points, 0)} points", "gaussians"),
        ),
        card(
            *("Time", f"{records.total_seconds:.1f} s", trained),
            *(f"{number(last.iteration if last else None, 0)} iterations", "time"),
        ),
    ]
    return f"<div class=cards>{''.join(cards)}</div>"


def _links(folder: Path) -> str:
    """Return links to the files beside the report, with their sizes; nothing where there are none."""
    links = [
        f'<a href="{name}">{words}</a> ({(folder / name).stat().st_size / 1e6:.1f} MB)'
        for name, words in _FILES.items()
        if (folder / name).is_file()
    ]
    return f"<p>Beside this page: {', '.join(links)}.</p>" if links else ""


def _verdict(result: Reconstruction) -> str:
    word, _, rest = result.verdict.words.partition(" " if not result.verdict.good else ":")
    kind = "good" if result.verdict.good else "poor"
    words = f"<b class={kind}>{escape(word.rstrip(',').capitalize())}</b>" if word else ""
    words += f"{':' if result.verdict.good else ','} {escape(rest.strip())}." if rest else ""
    warned = len(result.poses.findings)
    if warned:
        words += f' <a href="#recording">{counted(warned, "warning")} about the recording</a>.'
    return f"<p class=verdict>{words}</p>" if words else ""


def _glossary() -> str:
    terms = "".join(
        f"<dt id={name}>{escape(term)}</dt><dd>{escape(text)}</dd>"
        for name, (term, text) in WORDS.items()
    )
    return part("words", "Words", "what the figures mean", f"<dl>{terms}</dl>")
