"""Puts the report together."""

from concurrent.futures import Executor, ThreadPoolExecutor
from html import escape
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.init.start import Subject
from digs_warp.measure.scores import Score, SurfaceError
from digs_warp.pipeline.reconstruction import Reconstruction
from digs_warp.record import layout
from digs_warp.record.files import write_atomically
from digs_warp.show.report.capture_section import capture_section, sensor_section
from digs_warp.show.report.course_section import course_section
from digs_warp.show.report.geometry_section import geometry_section
from digs_warp.show.report.markup import CSS, card, number
from digs_warp.show.report.run_section import (
    RunRecords,
    figures_section,
    settings_section,
    times_section,
)
from digs_warp.show.report.view3d.section import start_view, view_section
from digs_warp.show.report.views_section import views_section
from digs_warp.words import counted

# The page needs nothing from elsewhere, and browsers refuse it should text from a file ask for it.
_ALLOWED = (
    "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'"
)

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
    with ThreadPoolExecutor(1, thread_name_prefix="film") as background:
        body = _body(capture, result, records, path, background)
    name = escape(_subject(capture, records))
    page = (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_ALLOWED}">\n'
        f"<title>{name} · digs-warp report</title>\n<style>{CSS}</style>\n</head>\n"
        f"<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )
    write_atomically(path, page.encode("utf-8", "backslashreplace"))


def _body(
    capture: Capture,
    result: Reconstruction,
    records: RunRecords,
    path: Path,
    background: Executor,
) -> str:
    """Return all sections; those of the Gaussians only where there are some to show."""
    posed = result.frames or PosedFrames.as_recorded(capture)
    view = start_view(result, posed, background) if len(result.gaussians) else None
    others = [
        *([geometry_section(result, posed)] if view else []),
        views_section(capture, result),
        course_section(result),
        figures_section(result),
        capture_section(capture, result.poses.findings),
        sensor_section(capture),
        times_section(records),
        settings_section(records),
    ]
    # The film is encoded while the pictures of the others are drawn.
    shown = [view_section(view)] if view else []
    return "\n".join([_header(capture, result, records, path), *shown, *others])


def _subject(capture: Capture, records: RunRecords) -> str:
    """Return what was captured: the mesh if the capture names it, else the folder's name."""
    settings = records.capture.settings if records.capture else {}
    if settings.get("scene"):
        return ", ".join(Path(name).stem for name in settings["scene"])
    if "mesh" in settings:
        return Path(settings["mesh"]).stem if settings["mesh"] else "Built-in object"
    return capture.folder.resolve().name


def _surface_cards(result: Reconstruction) -> list[str]:
    """Return the distances of the surface that are known."""
    cards = []
    if result.scores.surface is not None:
        accuracy = number(1e3 * result.scores.surface.accuracy, 2, "mm")
        cards.append(card("Accuracy", accuracy, "from the surface to the true one"))
        cards.append(_completeness_card(result.scores.surface))
    if result.training.adherence is not None:
        value = number(1e3 * result.training.adherence, 2, "mm")
        cards.append(card("Adherence", value, "from the surface to the measured depth, median"))
    return cards


def _completeness_card(surface: SurfaceError) -> str:
    whole = number(1e3 * surface.completeness, 2, "mm")
    if surface.seen_completeness is None:
        return card("Completeness", whole, "from the true surface to it")
    seen = number(1e3 * surface.seen_completeness, 2, "mm")
    note = f"from what the cameras see of the true surface to it; from all of it {whole}"
    return card("Completeness", seen, note)


def _object_cards(mean: Score) -> list[str]:
    return [
        card("PSNR", number(mean.psnr_object, 2, "dB"), "on the object, held-out views"),
        card("SSIM", number(mean.ssim_object, 4), "on the object, held-out views"),
    ]


def _frame_cards(mean: Score, subject: Subject) -> list[str]:
    note = "of everything in view, held-out views"
    if subject == "object":
        note = "with the white around the object"
    return [
        card("PSNR, frame", number(mean.psnr_frame, 2, "dB"), note),
        card("SSIM, frame", number(mean.ssim_frame, 4), note),
    ]


def _links(folder: Path) -> str:
    """Return links to the files beside the report, with their sizes; nothing where there are none."""
    links = [
        f'<a href="{name}">{words}</a> ({(folder / name).stat().st_size / 1e6:.1f} MB)'
        for name, words in _FILES.items()
        if (folder / name).is_file()
    ]
    return f"<p class=links>Beside this page: {', '.join(links)}.</p>" if links else ""


def _header(capture: Capture, result: Reconstruction, records: RunRecords, path: Path) -> str:
    k = capture.frames[0].camera.intrinsics
    mean = result.scores.mean
    last = result.course[-1] if result.course else None
    points = len(result.start.points) if result.start else None
    cards = [
        *(_object_cards(mean) if result.poses.subject == "object" else []),
        *_surface_cards(result),
        *_frame_cards(mean, result.poses.subject),
        card("Gaussians", f"{len(result.gaussians):,}", f"from {number(points, 0)} points"),
        card(
            "Training",
            number(last.seconds if last else None, 1, "s"),
            f"{number(last.iteration if last else None, 0)} iterations",
        ),
        card("Total", f"{records.total_seconds:.1f} s", "all stages"),
    ]
    held_out = len(result.scores.views)
    frames = counted(len(capture), "frame")
    about = f"{frames} of {k.width} by {k.height} pixels, {held_out} of them held out."
    return (
        f"<header><h1>{escape(_subject(capture, records))}</h1><p>{escape(about)}</p>"
        f"{_verdict(result)}<div class=cards>{''.join(cards)}</div>{_distances(result)}"
        f"{_links(path.parent)}</header>"
    )


def _verdict(result: Reconstruction) -> str:
    words = result.verdict.words
    return f"<p><strong>{escape(words)}</strong></p>" if words else ""


def _distances(result: Reconstruction) -> str:
    """Return the line on other distances; nothing where they were not measured."""
    words = str(result.scores.other_sizes or "")
    what = "PSNR" if result.poses.subject == "scene" else "PSNR on the object"
    return f"<p>{what}, exposure fitted: {escape(words)}.</p>" if words else ""
