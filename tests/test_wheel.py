"""The wheel, as users install it: its files, its names beside those of another project, its commands."""

import os
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

from digs_warp import __version__

# Build and install without a network: what they need comes with '.[dev]'.
pytest.importorskip("setuptools", minversion="77", reason="install it with: pip install '.[dev]'")
pytestmark = pytest.mark.long

REPOSITORY = Path(__file__).resolve().parent.parent
FOLDERS = {"digs_warp": "digs_warp", "sim": "digs_warp/sim", "usd": "digs_warp/usd"}
PACKED = ("pyproject.toml", "README.md", "LICENSE", *FOLDERS, "docs/study")

# Neither this checkout nor the environment of the suite may lend modules to what runs here.
ENVIRONMENT = {
    name: value
    for name, value in os.environ.items()
    if name not in ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
}


def run(*command: str | Path, cwd: Path) -> str:
    """Run a program and return what it prints, both streams."""
    done = subprocess.run(
        [*map(str, command)],
        cwd=cwd,
        env=ENVIRONMENT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"exit code {done.returncode}\n{done.stdout}"
    return done.stdout


def build(kind: str, source: Path, target: Path) -> Path:
    """Build a "wheel" or an "sdist" from a source tree, with the calls that pip makes."""
    target.mkdir()
    program = f"from setuptools.build_meta import build_{kind}; build_{kind}({str(target)!r})"
    run(sys.executable, "-c", program, cwd=source)
    (built,) = target.iterdir()
    return built


def environment(folder: Path, *requirement: str | Path) -> Path:
    """Make an environment that sees the dependencies of this one, install into it, return its bin."""
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    # A plain path: the .pth files in it, such as that of an editable install, are not followed.
    others = [path for path in sys.path if path.endswith("-packages")]
    (site / "dependencies.pth").write_text("\n".join(others))
    options = ["--no-deps", "--no-index", "--no-build-isolation", "--disable-pip-version-check"]
    pip = [sys.executable, "-m", "pip", "--python", folder / "bin/python", "install", "--quiet"]
    run(*pip, *options, *requirement, cwd=folder)
    return folder / "bin"


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what is packed: a build writes into its source tree, and packs what old ones left."""
    folder = tmp_path_factory.mktemp("source")
    for name in PACKED:
        if (REPOSITORY / name).is_dir():
            ignore = shutil.ignore_patterns("__pycache__")
            shutil.copytree(REPOSITORY / name, folder / name, symlinks=True, ignore=ignore)
        else:
            shutil.copy(REPOSITORY / name, folder)
    return folder


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", source, tmp_path_factory.mktemp("wheel") / "dist")


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the programs of an environment with the wheel in it."""
    return environment(tmp_path_factory.mktemp("installed"), wheel)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Another project, which has packages named sim and usd."""
    for name, content in {
        "sim/__init__.py": "def step():\n    return 'theirs'\n",
        "usd/__init__.py": "STAGE = 'theirs'\n",
        "tests/test_theirs.py": (
            "import usd\n"
            "from sim import step\n"
            "import digs_warp.sim.camera.rig, digs_warp.usd.writer\n"
            "def test_names(pytestconfig):\n"
            "    assert step() == usd.STAGE == 'theirs'\n"
            "    assert pytestconfig.pluginmanager.has_plugin('sensor_noise')\n"
        ),
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content)
    return tmp_path


def files_in(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_the_wheel_holds_one_package_with_every_file(wheel: Path) -> None:
    found = {name for name in files_in(wheel) if ".dist-info/" not in name}
    expected = {
        f"{package}/{path.relative_to(REPOSITORY / folder).as_posix()}"
        for folder, package in FOLDERS.items()
        for path in (REPOSITORY / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert found == expected
    assert {name.split("/")[0] for name in found} == {"digs_warp"}
    assert "digs_warp/py.typed" in found


def test_a_source_package_gives_the_same_wheel(source: Path, wheel: Path, tmp_path: Path) -> None:
    sdist = build("sdist", source, tmp_path / "sdist")
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    unpacked = tmp_path / sdist.name.removesuffix(".tar.gz")
    assert files_in(build("wheel", unpacked, tmp_path / "wheel")) == files_in(wheel)


def test_beside_a_project_with_the_same_names(installed: Path, project: Path) -> None:
    where = "import digs_warp, digs_warp.sim; print(digs_warp.__file__, *digs_warp.sim.__path__)"
    for place in run(installed / "python", "-c", where, cwd=project).split():
        assert Path(place).is_relative_to(installed.parent)
    # "python -m" puts the project's folders before all others, when pytest loads our plug-in, too.
    output = run(installed / "python", "-m", "pytest", "-q", "-p", "no:dash", cwd=project)
    assert "1 passed" in output


def test_the_command_answers(installed: Path, tmp_path: Path) -> None:
    assert f"digs-warp {__version__}" in run(installed / "digs-warp", "--version", cwd=tmp_path)
    assert "usage: digs-warp" in run(installed / "digs-warp", "--help", cwd=tmp_path)
    assert "usage: digs-warp run" in run(installed / "digs-warp", "run", "--help", cwd=tmp_path)
