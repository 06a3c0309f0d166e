"""Where the studies are that recommendations are made from."""

from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.engines.results import RESULTS
from digs_warp.study.engine.store import Store
from digs_warp.study.recommend.choose import Studies

# Results of docs/study: links in the repository, copies in an installed package.
PUBLISHED = Path(__file__).parents[1] / "published"


def study_folder(name: str, chosen: Path | None = None) -> Path:
    """Return the folder of a study's results: the chosen one, else one's own, else the published one.

    Raises:
        DigsError: there are no results in it.
    """
    own = Path("out/study") / name
    folder = chosen or (own if (own / RESULTS).is_file() else PUBLISHED / name)
    if not (folder / RESULTS).is_file():
        raise DigsError(
            f"no study in '{folder}'; measure one first: digs-warp study run {name} --out {folder}"
        )
    return folder


def read_studies(tradeoff: Path | None = None) -> Studies:
    """Read both studies; ``tradeoff``: folder of the trade-off study, as in `study_folder`."""
    folder = study_folder("tradeoff", tradeoff)
    scaling = Store(study_folder("scaling")).finished()
    return Studies(Store(folder).finished(), scaling, folder)
