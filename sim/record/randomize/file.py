"""A randomization: which settings are drawn, and from what. A YAML file, or one of ours by name.

base: indoor                      # the rest is as there; 'nothing' draws no more than what is named
light_level: {normal: [0, 0.5], limits: [-1, 1]}
profile: {choice: [zed2-720, d435], weights: [2, 1]}
environment: skies/*.hdr          # one of these files, relative to this file
frames: 20
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from digs_warp.checks import DigsError
from digs_warp.record.fields import shown
from digs_warp.record.files import read_yaml
from digs_warp.sim.record.randomize.distributions import Distribution
from digs_warp.sim.record.randomize.entries import Entry
from digs_warp.sim.record.randomize.keys import known_keys
from digs_warp.words import did_you_mean

SHIPPED_FOLDER = Path(__file__).resolve().parent
SHIPPED = tuple(sorted(path.stem for path in SHIPPED_FOLDER.glob("*.yaml")))
BASE, NOTHING, DEFAULT_BASE = "base", "nothing", "indoor"


@dataclass(frozen=True)
class Randomization:
    """Distributions of settings.

    Attributes:
        name: that of the file, or of ours.
        entries: by key.
    """

    name: str
    entries: Mapping[str, Distribution] = field(default_factory=dict)


def load_randomization(source: str | Path) -> Randomization:
    """Return one of ours by name, or read a YAML file.

    Raises:
        DigsError: an unknown name, or a file that is missing or broken; says which key, and what it expects.
    """
    if str(source) in SHIPPED:
        return _read(SHIPPED_FOLDER / f"{source}.yaml")
    if Path(source).suffix.lower() not in (".yaml", ".yml"):
        raise DigsError(
            f"randomization '{source}': not known{did_you_mean(str(source), SHIPPED)}, or a .yaml file"
        )
    return _read(Path(source))


def _read(path: Path) -> Randomization:
    where = f"randomization '{path}'"
    content = read_yaml(path, "randomization")
    base = content.pop(BASE, DEFAULT_BASE)
    if base not in (*SHIPPED, NOTHING):
        raise DigsError(
            f"{where}: {BASE} {shown(base)}, expected one of {', '.join((*SHIPPED, NOTHING))}"
        )
    if path.parent == SHIPPED_FOLDER and base != NOTHING:
        raise DigsError(f"{where}: {BASE} {shown(base)}, expected {NOTHING}: it is a base itself")
    known = known_keys()
    for name in content:
        if name not in known:
            raise DigsError(f"{where}: unknown key {shown(name)}{did_you_mean(str(name), known)}")
    own = {
        name: Entry(f"{where}: {name}", known[name], path.parent).read(found)
        for name, found in content.items()
    }
    rest = {} if base == NOTHING else load_randomization(base).entries
    return Randomization(path.stem, {**rest, **own})
