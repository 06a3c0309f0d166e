"""The tables of docs/what-is-read.md: what becomes of what each format holds, as the readers have it."""

from collections.abc import Iterable, Iterator

from digs_warp.formats.captures.formats import EXPORTERS, FILE_READERS, READERS
from digs_warp.formats.splats.files import FORMATS
from digs_warp.formats.table import DEPTH_IMAGES, FILMS, RECORDINGS, REFUSED_IMAGES, Form
from digs_warp.sim.scene.mesh.gltf import SPLATS as GLTF_SPLATS
from digs_warp.sim.scene.mesh.gltf import UNREADABLE_EXTENSIONS
from digs_warp.study.table import Table
from scripts.page_marks import fill

PAGE = "what-is-read.md"

# By suffix, as the readers have them.
SPLATS = (
    Form(
        ".ply, .compressed.ply",
        {
            "binary of either order, text, floats or doubles": "Gaussians of degree 0 to 3; with degree 4, "
            "up to 3",
            "comments": "what the splats are drawn with: ours, SplatRenderMode, antialiased",
            "centers far from the origin": "in double precision; written again as doubles",
            "values that look like a mistake": "as they are, and a warning names them",
            "the compressed form of SuperSplat": "Gaussians of degree 0 to 3",
        },
        {},
        {
            "NaN and infinite values": "--drop-broken leaves those Gaussians out",
        },
    ),
    Form(
        ".spz",
        {"versions 2, 3 and 4": "Gaussians, and the flag for antialiasing"},
        {"extension records": "of other programs"},
    ),
    Form(
        ".glb, .gltf",
        {
            "KHR_gaussian_splatting": "Gaussians of all nodes, under any similarity; floats, or integers for "
            "shares",
            "lin_rec709_display": "converted to sRGB",
        },
        {},
        {"compression extensions": "export it without, or as PLY or SPZ"},
    ),
    Form(
        ".sog",
        {"version 2, one archive": "Gaussians of degree 0 to 3, and whether they are antialiased"},
        {},
        {"version 1": "export it again, for example with SuperSplat"},
    ),
    Form(".splat", {"rows of 32 bytes": "Gaussians without view-dependent color"}),
    Form(
        ".usda, .usdc, .usdz, .usd",
        {
            "ParticleField3DGaussianSplat": "float or half, animated, under any similarity",
            "colors in another space": "converted to sRGB",
            "several fields": "the only visible one, or that of --prim",
            "packages in packages": "up to four",
            "no metersPerUnit": "centimetres, as USD says, with a warning",
        },
        {"fields that are invisible, proxies or guides": "which one is read instead"},
        {"transforms that shear": "bake them first"},
    ),
)
MESHES = (
    Form(
        ".glb, .gltf",
        {
            "triangles, strips, fans": "with skins, sparse and quantized accessors",
            "Draco, meshopt, KTX2, AVIF or DDS with plain data beside it": "the plain data",
        },
        {
            GLTF_SPLATS: "splats beside triangles",
            "morph targets, optional instances": "drawn in the basic shape, and once",
        },
        {f"{name} alone": cure for name, cure in UNREADABLE_EXTENSIONS.items()},
    ),
    Form(".obj", {"polygons, materials, textures": "in UTF-8 or UTF-16, with any mark"}),
    Form(
        ".ply",
        {
            "polygons, strips": "as triangles; long ones keep their notches",
            "colors": "8 or 16 bits or floats, also as diffuse_red, r or Red",
        },
        refuses={"points without faces": "turn a point cloud into a mesh first"},
    ),
    Form(
        ".stl",
        {"text, binary": "also without a count, with 'solid' in the header, or with bytes behind"},
        refuses={"fewer triangles than promised": "copy or export it again"},
    ),
)


def main() -> None:
    """Fill the page."""
    for mark, text in texts().items():
        fill(PAGE, mark, text)


def texts() -> dict[str, str]:
    """Return the tables by mark."""
    images = Form("images", DEPTH_IMAGES, refuses=REFUSED_IMAGES)
    return {
        "images": _table([images]),
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
    ".usda, .usdc, .usdz": "OpenUSD and NVIDIA's rules; usd-convert-gsplat (scripts/peers/usd_writers.py)",
    "colmap": "pycolmap, the rules of OpenSplat",
    "colmap-text": "pycolmap",
    "nerfstudio": "the rules of its data parser; Open3D (points)",
    "redwood": "Open3D",
    "kitti-stereo": "as RAFT and pykitti read it",
    "sceneflow": "as RAFT reads it",
    "euroc": "sample recordings",
    "ros": "rosbags wrote the bags",
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
            CHECKED.get(name, "files as its programs describe them"),
        ]
        for name in sorted(readers | EXPORTERS.keys())
    ]
    return Table("formats", ["format", "of", "read", "written", "checked with"], rows).markdown()


def _table(forms: Iterable[Form]) -> str:
    several = [row for form in forms for row in _rows(form)]
    return Table("forms", ["format", "what", "becomes"], several).markdown()


def _rows(form: Form) -> Iterator[list[str]]:
    name = f"`{form.name}`"
    for what, becomes in form.reads.items():
        yield [name, _what(what), f"read: {becomes}"]
        name = ""
    for what, words in form.leaves.items():
        yield [name, _what(what), f"left out, and said: {words}"]
    for what, cure in form.refuses.items():
        yield [name, what, f"**refused**: {cure}"]


def _what(what: str) -> str:
    """Return a path as code, words as they are."""
    return (
        what
        if " " in what or ("." not in what and "/" not in what and "*" not in what)
        else f"`{what}`"
    )
