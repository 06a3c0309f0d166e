"""The picture of `digs-warp bench convergence`: quality of held-out views along seconds and iterations."""

import io
from collections.abc import Sequence

from digs_warp.study.results import Result


def plot_convergence(results: Sequence[Result]) -> bytes:
    """Return a PNG with one curve per settings, against seconds on the left and iterations on the right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.2), layout="constrained")
    for axes, key in zip(figure.subplots(1, 2, sharey=True), ("seconds", "iteration"), strict=True):
        for name in dict.fromkeys(result.settings["settings"] for result in results):
            curve = [r for r in results if r.settings["settings"] == name]
            axes.plot(
                [r.settings[key] for r in curve], [r.value for r in curve], marker="o", label=name
            )
        axes.set_xlabel("training time [s]" if key == "seconds" else "iterations")
        axes.grid(alpha=0.3)
    axes.legend(loc="lower right")
    figure.axes[0].set_ylabel("PSNR of held-out views [dB]")
    splats, image = (results[0].settings[key] for key in ("splats", "image"))
    figure.suptitle(
        f"{splats:,} Gaussians from depth, {image} px, {results[0].settings['threads']} threads"
    )
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=110)
    return file.getvalue()
