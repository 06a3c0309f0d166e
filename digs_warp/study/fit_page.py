"""The page of a fit: the figures, what is not known, and measured beside simulated."""

from digs_warp.sim.camera.profiles import Profile
from digs_warp.sim.fit.result import Fit, text
from digs_warp.study.page import Section, html_page
from digs_warp.study.table import Table


def fit_page(fit: Fit, base: Profile, title: str) -> str:
    """Return the page as self-contained HTML; ``base`` is the profile that has the other figures."""
    doubts = " ".join(f"Beware: {doubt}." for doubt in fit.doubts)
    compared = [[row.name, text(row.measured), text(row.simulated)] for row in fit.comparisons]
    kept = [
        [name, f"{base.figures[name].value:g}", reason]
        for name, reason in fit.kept.items()
        if name in base.figures
    ]
    sections = [
        Section(
            "Figures",
            f"Values with standard errors, and those of the base, {base.title}. {doubts}".strip(),
            [figures_table(fit, base)],
        ),
        Section(
            "Measured beside simulated",
            "The statistics of the recording, and of the same scene recorded by the simulated camera with "
            "these figures.",
            [Table("wall", ["statistic of the wall", "measured", "simulated"], compared)],
        ),
        Section(
            "What this recording cannot tell",
            f"These figures are those of the base, {base.title}.",
            [Table("kept", ["figure", "base", "why it is not fitted"], kept)],
        ),
    ]
    return html_page(title, f"Fitted to: {fit.about}.", sections)


def figures_table(fit: Fit, base: Profile) -> Table:
    """Return the fitted figures beside the base's."""
    rows = [
        [figure.name, text(figure.estimate), f"{base.figures[figure.name].value:g}", figure.how]
        for figure in fit.figures
        if figure.name in base.figures
    ]
    return Table("figures", ["figure", "fitted", "base", "from"], rows)
