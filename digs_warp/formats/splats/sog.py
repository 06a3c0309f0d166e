"""Gaussians as SOG, the format of PlayCanvas for the web: pictures without loss (WebP) in a zip archive.

A pixel is a Gaussian. ``means_l`` and ``means_u``: the low and the high byte of sign(x) ln(1 + |x|) between
``mins`` and ``maxs``; ``quats``: the three smaller components times √2, the fourth's number + 252 (wxyz);
``scales`` and ``sh0``: places in a code book of 256 logarithms, and of 256 coefficients, with the opacity as
alpha; ``shN``: for each Gaussian the number of a row of a palette, whose coefficients are in a third code
book. Axes are those of PLY: not stored.
"""

import io
import json
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.bounds import GAUSSIANS, check_unpacked
from digs_warp.checks import DigsError, require_file
from digs_warp.data.gaussians import ANTIALIASED, CLASSIC, Gaussians
from digs_warp.formats.splats.rows import (
    WXYZ_FROM_XYZW,
    XYZW_FROM_WXYZ,
    codes_from_logits,
    in_morton_order,
    logits_from_codes,
    nearest_known,
    quats_from_three,
    smallest_three,
    sound,
    unit_quats,
)
from digs_warp.geometry.sh import coefficient_count
from digs_warp.record.fields import parse_json
from digs_warp.record.files import write_atomically

META = "meta.json"
_CODES = 256
_PALETTE_COLUMNS = 64  # rows of the palette beside each other in its picture
# Rows of the palette; more look hardly better and take minutes.
_MOST_ROWS = 4096
_STEPS = 5  # of the search for them
_SQRT_2 = np.sqrt(2.0)
# A picture takes at most this many bytes of a pixel, and this more.
_ROOM = 1 << 16


def read_sog(path: Path) -> Gaussians:
    """Read Gaussians.

    Raises:
        DigsError: no archive of this format, another version, damaged or truncated.
    """
    what = f"SOG '{path}'"
    with sound(what), zipfile.ZipFile(require_file(path, "SOG")) as archive:
        return _Reader(archive, what).gaussians()


class _Reader:
    def __init__(self, archive: zipfile.ZipFile, what: str) -> None:
        self._archive, self._what = archive, what
        self._meta = parse_json(self._file(META))
        if self._meta.get("version") != 2:
            raise DigsError(
                f"{what}: version {self._meta.get('version', 1)}, expected 2; export it again, for example "
                "with SuperSplat"
            )
        self._count = int(self._meta["count"])
        GAUSSIANS.check(what, self._count)

    def gaussians(self) -> Gaussians:
        """Decode all."""
        meta = self._meta
        means = self._texels("means", 0).astype(np.float64) + 256.0 * self._texels("means", 1)
        low, high = (np.array(meta["means"][end], np.float64) for end in ("mins", "maxs"))
        logs = low + (high - low) * means[:, :3] / 65535
        sh0, shades = self._texels("sh0"), np.array(meta["sh0"]["codebook"], np.float32)
        scales = np.array(meta["scales"]["codebook"], np.float32)
        sh = shades[sh0[:, :3]][:, None]
        if "shN" in meta:
            sh = np.concatenate([sh, self._rest()], axis=1)
        return Gaussians(
            means=np.sign(logs) * np.expm1(np.abs(logs)),
            log_scales=scales[self._texels("scales")[:, :3]],
            quats=_quaternions(self._texels("quats")),
            opacity_logits=logits_from_codes(sh0[:, 3]),
            sh=sh,
            screen_filter=ANTIALIASED if meta.get("model") == "antialiased" else CLASSIC,
        )

    def _rest(self) -> np.ndarray:
        """Return the coefficients above band 0, shape (n, K - 1, 3)."""
        meta = self._meta["shN"]
        count = coefficient_count(int(meta["bands"])) - 1
        labels = self._texels("shN", 1)[:, :2].astype(np.int64) @ [1, 256]
        codes = self._picture(meta["files"][0])[..., :3].reshape(-1, count, 3)
        return np.array(meta["codebook"], np.float32)[codes[labels]]

    def _texels(self, group: str, number: int = 0) -> np.ndarray:
        """Return the pixels of the Gaussians, shape (n, 4), uint8."""
        pixels = self._picture(self._meta[group]["files"][number]).reshape(-1, 4)
        if len(pixels) < self._count:
            raise DigsError(f"{self._what}: {group} of {len(pixels)} for {self._count} Gaussians")
        return pixels[: self._count]

    def _picture(self, name: str) -> np.ndarray:
        from PIL import Image

        data = io.BytesIO(self._file(name))
        try:
            with Image.open(data, formats=("WEBP", "PNG")) as picture:
                pixels = picture.width * picture.height
                check_unpacked(self._what, 4 * (self._count + _ROOM), pixels)
                return np.asarray(picture.convert("RGBA"))
        except Image.DecompressionBombError as error:
            raise DigsError(f"{self._what}, {name}: {error}") from None

    def _file(self, name: str) -> bytes:
        entry = self._archive.getinfo(name)
        check_unpacked(f"{self._what}, {name}", entry.compress_size, entry.file_size)
        return self._archive.read(entry)


def write_sog(path: Path, gaussians: Gaussians) -> None:
    """Write Gaussians, sorted along a curve through space."""
    g = in_morton_order(gaussians)
    width = 4 * int(np.ceil(np.sqrt(len(g)) / 4))
    height = 4 * int(np.ceil(len(g) / width / 4))
    files: dict[str, bytes] = {}

    def picture(name: str, texels: np.ndarray, size: tuple[int, int] = (width, height)) -> str:
        pixels = np.full((size[0] * size[1], 4), 255, np.uint8)
        pixels[len(texels) :] = 0
        pixels[: len(texels), : texels.shape[1]] = texels
        files[f"{name}.webp"] = _webp(pixels.reshape(size[1], size[0], 4))
        return f"{name}.webp"

    logs = np.sign(g.means) * np.log1p(np.abs(g.means.astype(np.float64)))
    low, high = logs.min(axis=0), logs.max(axis=0)
    steps = np.rint(65535 * (logs - low) / np.where(high > low, high - low, 1.0)).astype(np.int64)
    halves = [picture("means_l", steps & 255), picture("means_u", steps >> 8)]
    scale_book, scale_codes = _code_book(g.log_scales)
    shade_book, shade_codes = _code_book(g.sh[:, 0])
    shades = np.column_stack([shade_codes, codes_from_logits(g.opacity_logits)])
    meta: dict[str, Any] = {
        "version": 2,
        "count": len(g),
        "means": {"mins": low.tolist(), "maxs": high.tolist(), "files": halves},
        "scales": {"codebook": scale_book, "files": [picture("scales", scale_codes)]},
        "quats": {"files": [picture("quats", _quaternion_codes(g.quats))]},
        "sh0": {"codebook": shade_book, "files": [picture("sh0", shades)]},
    }
    if nearest_known(gaussians.screen_filter).antialias:
        meta["model"] = "antialiased"
    if g.sh_degree:
        rows, labels = _palette(g.sh[:, 1:].reshape(len(g), -1))
        book, codes = _code_book(rows)
        rest = g.sh.shape[1] - 1
        size = _PALETTE_COLUMNS * rest, -(-len(rows) // _PALETTE_COLUMNS)
        names = [
            picture("shN_centroids", codes.reshape(-1, 3), size),
            picture("shN_labels", np.column_stack([labels & 255, labels >> 8, 0 * labels])),
        ]
        bands = {"count": len(rows), "bands": g.sh_degree, "codebook": book, "files": names}
        meta["shN"] = bands
    files[META] = json.dumps(meta, separators=(",", ":")).encode()
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_STORED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name), content)  # no time: same input, same bytes
    write_atomically(path, data.getvalue())


def _webp(pixels: np.ndarray) -> bytes:
    from PIL import Image

    data = io.BytesIO()
    # Colors under alpha 0 are kept: they are numbers.
    Image.fromarray(pixels).save(data, "WEBP", lossless=True, exact=True, quality=60, method=2)
    return data.getvalue()


def _code_book(values: np.ndarray) -> tuple[list[float], np.ndarray]:
    """Return 256 ascending numbers that stand for values, and the place of the nearest for each, uint8."""
    flat = np.sort(values.reshape(-1).astype(np.float64))
    # Half of them where the values are, half evenly over all: few and far ones must not be lost.
    half = _CODES // 2
    quantiles = np.quantile(flat, (np.arange(half) + 0.5) / half)
    book = np.sort(np.concatenate([quantiles, np.linspace(flat[0], flat[-1], half)]))
    sums = np.concatenate([[0.0], np.cumsum(flat)])
    for _ in range(20):  # Lloyd's steps: each number moves to the mean of what it stands for
        ends = np.searchsorted(flat, 0.5 * (book[1:] + book[:-1]))
        ends = np.concatenate([[0], ends, [len(flat)]])
        held = np.diff(ends)
        means = np.diff(sums[ends]) / np.maximum(held, 1)
        book = np.sort(np.where(held > 0, means, book))
    codes = np.searchsorted(0.5 * (book[1:] + book[:-1]), values).astype(np.uint8)
    return book.astype(np.float32).tolist(), codes


def _palette(rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows that stand for coefficients, (n, m), and the number of the row of each, (n,)."""
    if len(rest) <= _PALETTE_COLUMNS:
        return rest, np.arange(len(rest))
    from sklearn.cluster import KMeans

    count = min(_MOST_ROWS, max(_PALETTE_COLUMNS, len(rest) // 4))
    means = KMeans(
        count,
        init="random",
        n_init=1,  # pyright: ignore[reportArgumentType]
        max_iter=_STEPS,
        random_state=0,
    )
    with warnings.catch_warnings(action="ignore"):  # rows that are equal, or steps that are few
        means.fit(rest[:: max(1, len(rest) // (16 * count))])
    return means.cluster_centers_, np.asarray(means.predict(rest), np.int64)


def _quaternions(texels: np.ndarray) -> np.ndarray:
    """Return unit quaternions xyzw, shape (n, 4)."""
    others = (texels[:, :3].astype(np.float64) / 127.5 - 1.0) / _SQRT_2
    return quats_from_three(texels[:, 3].astype(np.int64) - 252, others)[:, XYZW_FROM_WXYZ]


def _quaternion_codes(quats: np.ndarray) -> np.ndarray:
    """Return the pixels of quaternions xyzw, (n, 4), uint8."""
    which, others = smallest_three(unit_quats(quats)[:, WXYZ_FROM_XYZW])
    codes = np.rint(127.5 * (others * _SQRT_2 + 1.0)).clip(0, 255)
    return np.column_stack([codes, 252 + which]).astype(np.uint8)
