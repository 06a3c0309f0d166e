"""The sheen of cloth and the clear coat of varnish against integrals in double precision."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.sim.render.environment_light import WHITE_CARD
from digs_warp.sim.render.hit_material import sheen_shares
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene.environment import Environment
from digs_warp.sim.scene.scene import Material
from reference.plates import plate

UP = np.array([0.0, 0.0, 1.0])
EVEN = Environment(np.ones((16, 32, 3), np.float32))
BASE = np.array([0.5, 0.2, 0.1])
SHEEN = (0.1, 0.4, 0.3)
PAINT = Material("paint", BASE.astype(np.float32), roughness=0.9)
COSINES = (0.95, 0.5, 0.2)


def karis(f0: float, roughness: float, cosine: float) -> float:
    """Share of even light that a GGX coat reflects (Karis 2014)."""
    r = roughness * np.array([-1, -0.0275, -0.572, 0.022]) + np.array([1, 0.0425, 1.04, -0.04])
    a004 = min(r[0] ** 2, 2 ** (-9.28 * cosine)) * r[0] + r[1]
    return (r[2] - 1.04 * a004) * f0 + max(r[3] + 1.04 * a004, 0)


def charlie(roughness: float, cosine: float) -> float:
    """Share of even light that a white sheen scatters to the viewer, by angles in place of cosines."""
    polar, azimuth = np.meshgrid(
        (np.arange(800) + 0.5) / 800 * np.pi / 2, (np.arange(600) + 0.5) / 600 * 2 * np.pi
    )
    to_light = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
    )
    to_viewer = np.array([0.0, np.sqrt(1 - cosine**2), cosine])
    half = to_light + to_viewer[:, None, None]
    half /= np.linalg.norm(half, axis=0)
    power = 1 / roughness**2
    lobe = (2 + power) * (1 - half[2] ** 2) ** (power / 2) / (2 * np.pi)
    masked = 4 * (to_light[2] + cosine - to_light[2] * cosine)
    cell = np.sin(polar) * (np.pi / 2 / 800) * (2 * np.pi / 600)
    return float((lobe / masked * to_light[2] * cell).sum())


def seen(material: Material, cosine: float) -> np.ndarray:
    """Linear color of a plate under even light, at an angle from its normal, as a share of that light."""
    wall = plate((0, 0, 0), (0, 3, 0), (0, 0, 3), material)
    eye = 0.2 * np.array([cosine, np.sqrt(1 - cosine**2), 0.0])
    camera = Camera(Intrinsics.from_fov(3, 3, 1.0), look_at(eye, np.zeros(3), UP))
    image, _ = RaycastRenderer(wall, EVEN).render_image(camera, 4)
    return linear_from_srgb(image[1, 1] / 255) / WHITE_CARD


def without(cosine: float) -> np.ndarray:
    return BASE + karis(0.04, 0.9, cosine)


@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_the_share_of_a_sheen_is_the_integral_of_its_lobe(roughness: float) -> None:
    shares = sheen_shares(roughness)
    for step in (8, 16, 24, 32):
        expected = min(charlie(roughness, (step / 32) ** 2), 1.0)
        assert shares[step] == pytest.approx(expected, abs=4e-3)


@pytest.mark.parametrize("cosine", COSINES)
def test_fibers_scatter_light_and_leave_the_rest_to_the_cloth(cosine: float) -> None:
    cloth = replace(PAINT, sheen=SHEEN, sheen_roughness=0.6)
    share = np.array(SHEEN) * charlie(0.6, cosine)
    expected = share + (1 - share.max()) * without(cosine)
    np.testing.assert_allclose(seen(cloth, cosine), expected, atol=0.012)


@pytest.mark.parametrize("cosine", COSINES)
def test_varnish_reflects_light_and_leaves_the_rest_to_the_paint(cosine: float) -> None:
    varnished = replace(PAINT, clear_coat=0.8, clear_coat_roughness=0.1)
    reflected = 0.8 * karis(0.04, 0.1, cosine)
    expected = reflected + (1 - reflected) * without(cosine)
    np.testing.assert_allclose(seen(varnished, cosine), expected, atol=0.012)


def test_varnish_mirrors_what_rough_paint_does_not() -> None:
    sky = np.full((64, 128, 3), 0.2, np.float32)
    sky[:, 58:70] = 1.0  # a bright strip of the surround, in front of the wall
    black = replace(PAINT, base_color=np.zeros(3, np.float32), roughness=1.0)
    wall = plate((0, 0, 0), (0, 3, 0), (0, 0, 3), black)
    camera = Camera(
        Intrinsics.from_fov(90, 9, 100.0), look_at(np.array([1.0, 0, 0]), np.zeros(3), UP)
    )

    def contrast(material: Material) -> float:
        scene = replace(wall, materials=(material,))
        image, _ = RaycastRenderer(scene, Environment(sky)).render_image(camera, 4)
        row = linear_from_srgb(image[4] / 255).mean(axis=1)
        return float(np.abs(np.diff(row)).max() / row.mean())

    assert contrast(replace(black, clear_coat=1.0)) > 5 * contrast(black)
