"""Shading against closed forms: spots, highlights, mirrors, glass, textures, and the tables behind them."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportGeneralTypeIssues=false, reportIndexIssue=false

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from digs_warp.data.images import linear_from_srgb, srgb_from_linear
from digs_warp.geometry.camera import Camera, pixel_centers
from digs_warp.geometry.rigid import look_at
from digs_warp.geometry.sh import sh_basis
from digs_warp.sim.render.environment_light import (
    WHITE_CARD,
    irradiance_coefficients,
    prepare_light,
)
from digs_warp.sim.render.lighting import SPECULAR_COPIES, take_out_spots
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.render.textures import mip_chain
from digs_warp.sim.render.view import Encoding, srgb_byte, srgb_encoding
from digs_warp.sim.scene.environment import Environment, panorama_directions, solid_angles
from digs_warp.sim.scene.join import join_scenes
from digs_warp.sim.scene.scene import Material, Scene
from reference.plates import plate, scene_of
from reference.shading_scenes import (
    ABOVE,
    BLACK,
    FRONT,
    INTRINSICS,
    MATTE,
    UP,
    floor,
    glow,
    linear_image,
    sunny,
    wall,
)

# ---- spots and shadows ----


def test_the_sun_casts_a_shadow_where_geometry_says() -> None:
    environment, sun = sunny()
    assert sun[2] > 0.4
    scene = join_scenes(floor(MATTE), floor(MATTE, z=0.15, half=0.09))
    renderer = RaycastRenderer(scene, environment)
    image, mask = renderer.render_image(ABOVE)
    depth = renderer.render_geometry(ABOVE)[0]
    points = ABOVE.unproject(pixel_centers(160, 90), depth)
    on_floor = (np.abs(points[..., 2]) < 1e-3) & (mask == 255)
    # Where the way to the sun passes the height of the small plate.
    crossing = np.abs((points + (0.15 - points[..., 2:]) * sun / sun[2])[..., :2]).max(axis=-1)
    # A margin for half the texel's own width, which lies aslant (the penumbra), and for a pixel.
    edge = 0.15 * (np.pi / 64) / sun[2] ** 2 + 0.01
    shadow, lit = on_floor & (crossing < 0.09 - edge), on_floor & (crossing > 0.09 + edge)
    assert shadow.sum() > 20 and lit.sum() > 1000
    assert image[shadow].max() < 30 and image[lit].min() > 150


def test_a_round_body_of_few_faces_has_no_steps_at_its_terminator() -> None:
    """Brightness falls smoothly toward the dark side although shadow rays start on flat faces."""
    segments = 8
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    vertices = np.concatenate([0.3 * ring - 0.4 * UP, 0.3 * ring + 0.4 * UP])
    a = np.arange(segments)
    b = a + segments + 1
    faces = np.concatenate([np.stack([a, a + 1, b + 1], 1), np.stack([a, b + 1, b], 1)])
    cylinder = scene_of(vertices, faces, np.concatenate([ring, ring]), MATTE)
    environment, sun = sunny(sky=5.0)
    side = 1.2 * np.cross(UP, sun) / np.linalg.norm(np.cross(UP, sun))  # sees light and dark half
    camera = Camera(INTRINSICS, look_at(side, np.zeros(3), UP))
    renderer = RaycastRenderer(cylinder, environment)
    row = linear_image(renderer, camera, 64)[45, :, 0]
    shown = row[renderer.render_image(camera, 4)[1][45] == 255]
    assert np.ptp(shown) > 0.3
    assert np.abs(np.diff(shown)).max() < 0.1 * np.ptp(shown)


def test_spots_and_rest_together_keep_the_light() -> None:
    environment, sun = sunny(sun=2000.0, sky=1.0)
    radiance = environment.radiance.astype(np.float64)
    smooth, keys = take_out_spots(radiance)
    assert keys.count == 1
    vector, color = keys.vectors.numpy()[0], keys.colors.numpy()[0]
    np.testing.assert_allclose(vector, sun, atol=1e-3)
    directions, areas = panorama_directions(64, 32), solid_angles(64, 32)
    for normal in (sun, UP, np.array([0.6, 0, -0.8])):
        cosine = np.maximum(directions @ normal, 0)[..., None]
        expected = (radiance * cosine * areas[..., None]).sum(axis=(0, 1)) / np.pi
        found = max(float(normal @ vector), 0.0) * color
        found = found + (sh_basis(normal, 2) @ irradiance_coefficients(smooth))
        np.testing.assert_allclose(found, expected, rtol=0.03)


GLOSS = Material("gloss", np.zeros(3, np.float32), roughness=0.4)
LAMPS = {"left": np.array([-0.35, 0.25, 0.9]), "right": np.array([-0.35, -0.25, 0.9])}
LAMP_HEIGHT = 64
TOWARD = np.array([0.35, 0.0, 0.9])  # to the camera: it sees the lobe midway between both lamps
SKY = 0.3


def texels(name: str) -> tuple[slice, slice]:
    """The four texels of a lamp."""
    directions = panorama_directions(2 * LAMP_HEIGHT, LAMP_HEIGHT)
    row, column = divmod(int((directions @ LAMPS[name]).argmax()), 2 * LAMP_HEIGHT)
    return slice(row, row + 2), slice(column, column + 2)


def lamps(*names: str) -> Environment:
    """An even sky with some of the lamps."""
    radiance = np.full((LAMP_HEIGHT, 2 * LAMP_HEIGHT, 3), SKY, np.float32)
    for name in names:
        radiance[texels(name)] = 2000.0
    return Environment(radiance)


def blind(name: str) -> Scene:
    """A plate 1 m away that hides a lamp from the origin."""
    toward = panorama_directions(2 * LAMP_HEIGHT, LAMP_HEIGHT)[texels(name)].mean(axis=(0, 1))
    return plate(tuple(toward / np.linalg.norm(toward)), (0.1, 0, 0), (0, 0.1, 0), MATTE)


def lobe_light(environment: Environment, mirrored: np.ndarray, roughness: float) -> float:
    """Mean over the GGX lobe, in double precision over every texel (Karis 2013, n = v = r)."""
    height = environment.radiance.shape[0]
    cosine = panorama_directions(2 * height, height) @ (mirrored / np.linalg.norm(mirrored))
    alpha2 = roughness**4
    weight = np.maximum(cosine, 0) / ((1 + cosine) / 2 * (alpha2 - 1) + 1) ** 2
    weight = weight * solid_angles(2 * height, height)
    return float((weight * environment.radiance[..., 0]).sum() / weight.sum())


@pytest.mark.parametrize("hidden", [("left",), ("left", "right")])
def test_a_lamp_in_the_shadow_has_no_highlight(hidden: tuple[str, ...]) -> None:
    both = lamps(*LAMPS)
    camera = Camera(INTRINSICS, look_at(TOWARD, np.zeros(3), UP))
    blinds = [blind(name) for name in hidden]
    renderer = RaycastRenderer(join_scenes(floor(GLOSS, half=0.1), *blinds), both)
    middle = linear_image(renderer, camera)[44:46, 79:81].mean()
    left_over = lamps(*(name for name in LAMPS if name not in hidden))
    mirrored = TOWARD * (-1, -1, 1)
    light, every = (lobe_light(each, mirrored, GLOSS.roughness) for each in (left_over, both))
    alone = RaycastRenderer(floor(GLOSS, half=0.1), both)
    plain = linear_image(alone, camera)[44:46, 79:81].mean()
    assert plain < 0.9  # not clipped
    assert middle == pytest.approx(plain * light / every, rel=0.1, abs=0.002)
    assert middle < 0.7 * plain


# ---- mirrors ----


def test_smooth_metal_mirrors_the_object() -> None:
    """The lamp's picture in the floor appears below it, at the height of its mirror image."""
    chrome = Material("chrome", np.ones(3, np.float32), roughness=0.0, metallic=1.0)
    lamp = plate((-0.3, 0, 0.15), (0, 0.05, 0), (0, 0, 0.05), glow(1.0))
    (u, v), _ = ABOVE.project(np.array([-0.3, 0.0, -0.15]))
    shown = {}
    for name, metal in {
        "smooth": chrome,
        "rough": replace(chrome, roughness=0.9),
        "plastic": replace(chrome, metallic=0.0),
    }.items():
        image = linear_image(RaycastRenderer(join_scenes(floor(metal), lamp), BLACK), ABOVE)
        shown[name] = image[int(v), int(u), 0]
    assert shown["smooth"] > 0.9
    assert shown["rough"] == 0 and shown["plastic"] == 0


def test_a_flat_mirror_shows_the_surround_at_its_distance() -> None:
    """The two eyes see a mirror image as far behind the mirror as its object is in front of it."""
    chrome = Material("chrome", np.ones(3, np.float32), roughness=0.0, metallic=1.0)
    radiance = np.full((64, 128, 3), 0.2, np.float32)
    radiance[30:34, 62:66] = 1.0  # a bright square straight behind the camera, at (4, 0, 0)
    renderer = RaycastRenderer(wall(chrome), Environment(radiance))
    columns = []
    for eye in (FRONT, FRONT.shifted_right(0.12)):
        row = linear_image(renderer, eye, 64)[45, :, 0]
        bright = np.maximum(row - 0.8, 0)
        columns.append((bright * (np.arange(160) + 0.5)).sum() / bright.sum())
    expected = INTRINSICS.fx * 0.12 / 5.0  # one metre to the mirror, four behind it
    assert columns[0] - columns[1] == pytest.approx(expected, abs=0.3)


# ---- glass and glow ----


def test_glass_tints_what_lies_behind() -> None:
    tint = np.array([0.5, 1.0, 0.25], np.float32)
    glass = Material("glass", tint, transmission=1.0, roughness=0.0)
    scene = join_scenes(wall(glass), wall(glow(0.8), x=-0.3, half=0.6))
    middle = linear_image(RaycastRenderer(scene, BLACK), FRONT)[45, 80]
    # The coat takes away 4 percent at right angles.
    np.testing.assert_allclose(middle, 0.8 * tint * 0.96, atol=0.012)


@pytest.mark.parametrize("panes", [1, 2, 3])
def test_panes_cover_with_their_opacity_one_after_the_other(panes: int) -> None:
    soot = Material("soot", np.zeros(3, np.float32), opacity=0.25, roughness=1.0)
    layers = [wall(soot, x=0.05 * i) for i in range(panes)]
    scene = join_scenes(*layers, wall(glow(1.0), x=-0.3, half=0.6))
    image, mask = RaycastRenderer(scene, BLACK).render_image(FRONT, 4)
    assert linear_from_srgb(image[45, 80, 0] / 255) == pytest.approx(0.75**panes, abs=0.01)
    assert mask[45, 80] == 255


# ---- textures of the surface ----


def encoded(normal: np.ndarray) -> np.ndarray:
    """A normal map that says the same everywhere."""
    pixel = np.rint(128 + 127 * normal).clip(0, 255).astype(np.uint8)
    return np.broadcast_to(pixel, (4, 4, 3)).copy()


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("tilt", [(0.5, 0.0), (0.0, 0.5), (-0.3, 0.4)])
def test_a_normal_map_shades_like_tilted_normals(tilt: tuple[float, float], mirrored: bool) -> None:
    """On a wall whose texture runs along y (or against it, mirrored) and z."""
    local = np.array([*tilt, np.sqrt(1 - tilt[0] ** 2 - tilt[1] ** 2)])
    shiny = replace(MATTE, roughness=0.3)
    smooth = wall(shiny)
    mapped = replace(smooth, materials=(replace(shiny, normal_texture=encoded(local)),))
    if mirrored:
        mapped = replace(mapped, uvs=mapped.uvs * np.array([-1, 1], np.float32))
    along_u = -1.0 if mirrored else 1.0
    world = np.array([local[2], along_u * local[0], local[1]], np.float32)
    tilted = replace(smooth, normals=np.tile(world, (4, 1)))
    sky = Environment((panorama_directions(64, 32) + 1).astype(np.float32))
    a, b, flat = (
        RaycastRenderer(s, sky).render_image(FRONT)[0].astype(int) for s in (mapped, tilted, smooth)
    )
    # Eight bits tilt a normal by a quarter of a degree, and openness goes by the vertex normals.
    assert np.abs(a - b).max() <= 8
    assert np.abs(b - flat).max() > 15


@pytest.mark.parametrize("shape", [(64, 64), (17, 5), (1, 9), (100, 37), (1, 1)])
def test_every_level_of_a_pyramid_has_the_mean_of_the_image(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(0).uniform(0, 1, (*shape, 3)).astype(np.float32)
    chain = mip_chain(image)
    assert chain[-1].shape == (1, 1, 3)
    for level in chain:
        np.testing.assert_allclose(level.mean(axis=(0, 1)), image.mean(axis=(0, 1)), atol=1e-5)


def test_irradiance_is_the_cosine_integral_of_a_smooth_sky() -> None:
    directions = panorama_directions(128, 64)
    radiance = 1 + 0.5 * directions[..., 2:] + 0.3 * directions[..., :1] * directions[..., 1:2]
    radiance = np.repeat(radiance, 3, axis=-1)
    normals = np.array([[0, 0, 1.0], [0.6, 0, -0.8], [-0.48, 0.6, 0.64]])
    found = sh_basis(normals, 2) @ irradiance_coefficients(radiance)
    cosine = np.maximum(np.einsum("nc,hwc->nhw", normals, directions), 0.0)
    weights = cosine * solid_angles(128, 64)
    expected = np.einsum("nhw,hwc->nc", weights, radiance) / np.pi
    np.testing.assert_allclose(found, expected, rtol=2e-3)


def test_exposure_puts_a_white_card_where_it_belongs_whatever_the_brightness() -> None:
    radiance = np.random.default_rng(0).uniform(0, 1, (32, 64, 3)).astype(np.float32)
    (dim, faint), (bright, strong) = (
        prepare_light(Environment(radiance * gain)) for gain in (1e-3, 1e3)
    )
    assert dim == pytest.approx(1e6 * bright, rel=1e-4)
    means = [light.irradiance.numpy()[0] * 0.28209479177387814 for light in (faint, strong)]
    assert means[0].mean() == pytest.approx(WHITE_CARD, rel=0.02)
    np.testing.assert_allclose(*means, rtol=1e-4)


def test_blurred_copies_keep_the_mean_and_lose_contrast() -> None:
    radiance = np.random.default_rng(0).uniform(0, 1, (64, 128, 3)).astype(np.float32)
    radiance[10:20, 30:40] = 20.0
    _, light = prepare_light(Environment(radiance))
    copies = light.specular.texels.numpy().reshape(SPECULAR_COPIES, 64, 128, 3)
    assert np.isfinite(copies).all()
    weights = solid_angles(128, 64)[..., None] / (4 * np.pi)
    means = (copies * weights).sum(axis=(1, 2))
    np.testing.assert_allclose(means, np.broadcast_to(means[0], means.shape), rtol=0.05)
    peaks = copies.max(axis=(1, 2, 3))
    assert (np.diff(peaks) < 0).all()


@wp.kernel
def encode_kernel(encoding: Encoding, linear: wp.array[float], encoded: wp.array[wp.uint8]):
    """Encode one value."""
    i = wp.tid()
    encoded[i] = srgb_byte(encoding, linear[i])


def bytes_of(linear: np.ndarray) -> np.ndarray:
    values = wp.array(linear, dtype=float, device="cpu")
    result = wp.zeros(len(linear), dtype=wp.uint8, device="cpu")
    wp.launch(encode_kernel, len(linear), inputs=[srgb_encoding(), values, result], device="cpu")
    return result.numpy()


def test_bytes_are_the_nearest_ones_from_black_to_beyond_white() -> None:
    rng = np.random.default_rng(0)
    linear = np.concatenate(
        [rng.uniform(-0.5, 1.5, 20_000), rng.random(20_000) ** 3, np.arange(4097) / 4096]
    )
    linear = linear.astype(np.float32)
    exact = 255 * srgb_from_linear(np.clip(linear.astype(np.float64), 0, 1))
    assert np.abs(bytes_of(linear) - exact).max() <= 0.5 + 1e-4
