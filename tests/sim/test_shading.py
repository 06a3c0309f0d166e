"""Shading against closed forms: shadows, mirrors, glass, glow, normal maps, and extreme light."""

from dataclasses import replace

import numpy as np
import pytest

from digs_warp.camera import Camera, Intrinsics, pixel_centers
from digs_warp.data.images import linear_from_srgb
from digs_warp.geometry import look_at
from digs_warp.sh import sh_basis
from digs_warp.sim.environment import Environment
from digs_warp.sim.join import join_scenes
from digs_warp.sim.panorama import panorama_directions, solid_angles
from digs_warp.sim.render.environment_light import irradiance_coefficients
from digs_warp.sim.render.key_lights import take_out_spots
from digs_warp.sim.render.raycast import RaycastRenderer
from digs_warp.sim.scene import Material, Scene
from reference.plates import plate

UP = np.array([0.0, 0.0, 1.0])
INTRINSICS = Intrinsics.from_fov(160, 90, 60.0)
BLACK = Environment(np.zeros((16, 32, 3), np.float32))
WHITE = Environment(np.ones((16, 32, 3), np.float32))
MATTE = Material("matte", np.full(3, 0.5, np.float32))
# From the front (+x), one metre away, and from above at an angle.
FRONT = Camera(INTRINSICS, look_at(np.array([1.0, 0, 0]), np.zeros(3), UP))
ABOVE = Camera(INTRINSICS, look_at(np.array([0.8, 0, 0.8]), np.zeros(3), UP))


def wall(material: Material, x: float = 0.0, half: float = 0.3) -> Scene:
    return plate((x, 0, 0), (0, half, 0), (0, 0, half), material)


def floor(material: Material, z: float = 0.0, half: float = 0.4) -> Scene:
    return plate((0, 0, z), (half, 0, 0), (0, half, 0), material)


def glow(level: float) -> Material:
    """Black but for its own light."""
    return Material("glow", np.zeros(3, np.float32), emission=(level, level, level))


def sunny(sun: float = 70000.0, sky: float = 0.5) -> tuple[Environment, np.ndarray]:
    """An even sky with one bright texel; also the direction of that texel."""
    radiance = np.full((32, 64, 3), sky, np.float32)
    radiance[10, 20] = sun
    return Environment(radiance), panorama_directions(64, 32)[10, 20]


def linear_image(renderer: RaycastRenderer, camera: Camera, samples: int = 16) -> np.ndarray:
    return linear_from_srgb(renderer.render_image(camera, samples)[0] / 255.0)


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
    cylinder = Scene(
        vertices=vertices.astype(np.float32),
        faces=faces.astype(np.int32),
        face_materials=np.zeros(len(faces), np.int32),
        normals=np.concatenate([ring, ring]).astype(np.float32),
        uvs=np.zeros((len(vertices), 2), np.float32),
        vertex_colors=np.ones((len(vertices), 3), np.float32),
        materials=(MATTE,),
    )
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


def test_two_lamps_are_two_spots_and_their_points_lie_on_them() -> None:
    radiance = np.full((64, 128, 3), 0.1)
    radiance[20:24, 30:34] = 60.0
    radiance[30:36, 90:96] = 30.0
    _, keys = take_out_spots(radiance)
    assert keys.count == 2
    points = keys.points.numpy()
    for spot, (rows, columns) in enumerate([((20, 24), (30, 34)), ((30, 36), (90, 96))]):
        directions = panorama_directions(128, 64)[slice(*rows), slice(*columns)].reshape(-1, 3)
        distance = np.linalg.norm(points[spot][:, None] - directions, axis=-1).min(axis=1)
        assert distance.max() < np.sqrt(0.5) * np.pi / 64 + 1e-6
        # Every texel of an even lamp is aimed at about equally often.
        nearest = np.linalg.norm(points[spot][:, None] - directions, axis=-1).argmin(axis=1)
        assert len(np.unique(nearest)) >= min(len(directions), 16)


@pytest.mark.parametrize("environment", [WHITE, BLACK])
def test_even_surrounds_have_no_spots(environment: Environment) -> None:
    smooth, keys = take_out_spots(environment.radiance.astype(np.float64))
    assert keys.count == 0
    np.testing.assert_array_equal(smooth, environment.radiance)


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


def test_an_unused_transparent_material_changes_nothing() -> None:
    opaque = wall(MATTE)
    with_glass = replace(opaque, materials=(MATTE, Material("glass", np.ones(3), opacity=0.1)))
    sky = Environment(np.random.default_rng(0).uniform(0.5, 1.5, (16, 32, 3)).astype(np.float32))
    images = [
        RaycastRenderer(scene, sky).render_image(FRONT)[0].astype(int)
        for scene in (opaque, with_glass)
    ]
    assert np.abs(images[0] - images[1]).max() <= 1


@pytest.mark.parametrize("gain", [1e-3, 1.0, 1e3])
def test_glow_does_not_depend_on_the_exposure(gain: float) -> None:
    sky = Environment(np.full((16, 32, 3), gain, np.float32))
    lamp = replace(glow(0.5), metallic=1.0)  # black metal: reflects nothing
    middle = linear_image(RaycastRenderer(wall(lamp), sky), FRONT)[45, 80]
    assert middle[0] == pytest.approx(0.5, abs=0.02)


def test_an_emission_texture_glows_where_it_is_bright() -> None:
    texture = np.zeros((64, 64, 3), np.uint8)
    texture[:, 32:] = (255, 0, 0)
    lamp = replace(glow(1.0), emission_texture=texture)
    image = linear_image(RaycastRenderer(wall(lamp), BLACK), FRONT)
    right, left = FRONT.project(np.array([[0, 0.15, 0], [0, -0.15, 0]]))[0].astype(int)
    np.testing.assert_allclose(image[45, right[0]], [1, 0, 0], atol=0.01)
    assert image[45, left[0]].max() == 0


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


def test_a_finish_texture_that_says_the_same_everywhere_is_the_plain_finish() -> None:
    plain = replace(MATTE, roughness=51 / 255, metallic=204 / 255)
    texture = np.broadcast_to(np.array([51, 204], np.uint8), (8, 8, 2)).copy()
    sky = Environment(np.random.default_rng(0).uniform(0.2, 1.8, (16, 32, 3)).astype(np.float32))
    a, b = (
        RaycastRenderer(wall(m), sky).render_image(FRONT)[0].astype(int)
        for m in (plain, replace(plain, finish_texture=texture))
    )
    assert np.abs(a - b).max() <= 1


# ---- extreme light ----


def test_a_black_surround_shows_nothing_and_measures_all() -> None:
    view = RaycastRenderer(wall(MATTE), BLACK).render(FRONT)
    assert not view.image.any()
    assert view.mask[45, 80] == 255 and view.depth[45, 80] == pytest.approx(1.0, rel=1e-5)


def test_a_white_surround_is_even() -> None:
    view = RaycastRenderer(wall(MATTE), WHITE).render(FRONT)
    surround = view.image[view.mask == 0]
    assert len(surround) > 1000 and np.ptp(surround) <= 1


def test_a_sun_of_70000_leaves_no_speckles_on_matte_surfaces() -> None:
    """Random samples never hit the sun directly, so neighbors on a plane get the same light."""
    environment, _ = sunny(sun=70000.0, sky=20.0)
    renderer = RaycastRenderer(floor(MATTE), environment)
    image, mask = renderer.render_image(ABOVE)
    level, on_floor = image[..., 0].astype(int), mask == 255
    beside = on_floor[:, 1:] & on_floor[:, :-1]
    assert np.abs(np.diff(level, axis=1))[beside].max() <= 1
    assert np.ptp(level[on_floor]) <= 5 and level[on_floor].min() > 100


def test_glass_and_shadows_do_not_depend_on_threads() -> None:
    environment, _ = sunny()
    glass = Material("glass", np.ones(3, np.float32), transmission=0.9, roughness=0.1)
    scene = join_scenes(floor(MATTE), floor(MATTE, z=0.15, half=0.06), wall(glass, x=0.2))
    a, b = (
        RaycastRenderer(scene, environment, threads).render(ABOVE, seed=3) for threads in (1, 2)
    )
    np.testing.assert_array_equal(a.image, b.image)
    np.testing.assert_array_equal(a.mask, b.mask)


def test_a_camera_inside_the_object_sees_its_inside() -> None:
    """No near plane cuts anything off."""
    near = plate((0.0005, 0, 0), (0, 0.3, 0), (0, 0, 0.3), MATTE)
    camera = Camera(INTRINSICS, look_at(np.array([0.001, 0, 0]), np.array([-1.0, 0, 0]), UP))
    view = RaycastRenderer(near, WHITE).render(camera)
    assert (view.material_ids == 0).all() and (view.mask == 255).all()
    np.testing.assert_allclose(view.depth, 0.0005, rtol=1e-3)


# ---- highlights ----

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


@pytest.mark.parametrize("hidden", [(), ("left",), ("left", "right")])
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
    if hidden:
        assert middle < 0.7 * plain
