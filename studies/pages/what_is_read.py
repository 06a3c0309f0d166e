"""The tables of docs/what-is-read.md: what becomes of what each format holds, as the readers have it."""

from collections.abc import Iterable

from digs_warp.formats.captures.formats import EXPORTERS, FILE_READERS, READERS
from digs_warp.formats.splats.files import FORMATS
from digs_warp.formats.table import FILMS, RECORDINGS, Form
from digs_warp.sim.scene.mesh.gltf import SPLATS as GLTF_SPLATS
from digs_warp.sim.scene.mesh.gltf import UNREADABLE_EXTENSIONS
from digs_warp.study.table import Table
from scripts.page_marks import fill

PAGE = "what-is-read.md"

# By suffix, as the readers have them.
SPLATS = (
    Form(
        ".ply, .compressed.ply",
        "degree 0 to 3 (of 4, up to 3), either byte order, text, floats or doubles; what draws them",
        refuses="NaN and infinite values, unless --drop-broken",
    ),
    Form(
        ".spz",
        "versions 2, 3 and 4, the flag for antialiasing",
        {"extensions": "of other programs"},
    ),
    Form(
        ".glb, .gltf",
        "KHR_gaussian_splatting of all nodes, under any similarity, either color space",
        refuses="compression extensions",
    ),
    Form(".sog", "version 2, one archive", refuses="version 1"),
    Form(".splat", "rows of 32 bytes, without view-dependent color"),
    Form(
        ".usda, .usdc, .usdz, .usd",
        "ParticleField3DGaussianSplat, float or half, animated, under any similarity; of several fields the "
        "only visible one or --prim; centimetres where no unit is given",
        {"other fields": "invisible ones, proxies and guides"},
        "transforms that shear",
    ),
)
MESHES = (
    Form(
        ".glb, .gltf",
        "triangles, strips, fans; skins, sparse and quantized accessors",
        {
            GLTF_SPLATS: "splats",
            "morph targets, optional instances": "drawn in the basic shape, and once",
        },
        ", ".join(UNREADABLE_EXTENSIONS) + " without plain data beside it",
    ),
    Form(".obj", "polygons, materials, textures; UTF-8 or UTF-16"),
    Form(
        ".ply", "polygons, strips, colors of 8 or 16 bits or floats", refuses="points without faces"
    ),
    Form(".stl", "text and binary", refuses="fewer triangles than promised"),
)


def main() -> None:
    """Fill the page."""
    for mark, text in texts().items():
        fill(PAGE, mark, text)


def texts() -> dict[str, str]:
    """Return the tables by mark."""
    return {
        "recordings": _table([*RECORDINGS.values(), *FILMS]),
        "splats": _table(SPLATS),
        "formats": _formats(),
        "meshes": _table(MESHES),
    }


# What else than our own reader has read our files, or written those that we read; in the suite, or by the
# script that is named.
CHECKED = {
    ".ply": "samples of others; trimesh and Open3D (points), splat-transform",
    ".compressed.ply": "splat-transform, both ways (scripts/peers/splat_transform.py)",
    ".spz": "samples of versions 2 to 4; gsply where it is installed",
    ".splat": "samples of others",
    ".sog": "splat-transform, both ways (scripts/peers/splat_transform.py)",
    ".glb": "the rules of Khronos; trimesh (points); files of splat-transform",
    ".gltf": "the rules of Khronos",
    ".usda, .usdc, .usdz": "OpenUSD's rules; usd-convert-gsplat (scripts/peers/usd_writers.py)",
    "colmap": "pycolmap, the rules of OpenSplat",
    "colmap-text": "pycolmap",
    "nerfstudio": "the rules of its data parser; Open3D (points)",
    "redwood": "Open3D",
    "kitti-stereo": "as RAFT and pykitti read it",
    "sceneflow": "as RAFT reads it",
    "hdf5": "h5py",
    "webdataset": "webdataset",
    "ros": "rosbags wrote the bags",
    "realsense": "pyrealsense2 wrote the bags",
}
_YES, _NO = "yes", ""


def _formats() -> str:
    """Return the table of what is read, what is written, and who has checked it."""
    rows = [
        [f"`{suffix}`", "splats", _YES, _YES if form.write else _NO, CHECKED.get(suffix, "")]
        for suffix, form in FORMATS.items()
    ]
    usd = ".usda, .usdc, .usdz"
    rows.append([f"`{usd}`", "splats and scenes", _YES, _YES, CHECKED[usd]])
    readers = {*READERS, *FILE_READERS}
    rows += [
        [
            *(f"`{name}`", "recordings"),
            *(_YES if name in group else _NO for group in (readers, EXPORTERS)),
            CHECKED.get(name, "its description"),
        ]
        for name in sorted(readers | EXPORTERS.keys())
    ]
    return Table("formats", ["format", "of", "read", "written", "checked with"], rows).markdown()


def _table(forms: Iterable[Form]) -> str:
    rows = [
        [
            f"`{form.name}`",
            form.reads,
            "; ".join(f"{_what(each)} ({words})" for each, words in form.leaves.items()),
            form.refuses,
        ]
        for form in forms
    ]
    return Table("forms", ["format", "read", "left out, and said", "refused"], rows).markdown()


def _what(what: str) -> str:
    """Return a pattern as code, words as they are."""
    return f"`{what}`" if "*" in what or "." in what else what
