"""Which materials are mirrors, glossy or transparent."""

from digs_warp.sim.scene.scene import Material

# A metal this smooth reflects its surroundings sharply.
MIRROR_METALLIC, MIRROR_ROUGHNESS = 0.5, 0.1

# Rougher surfaces blur a highlight so much that it has no gradient to match.
GLOSSY_ROUGHNESS = 0.3


def is_mirror(material: Material) -> bool:
    """Whether a matcher matches the reflected scene instead of the surface."""
    return material.metallic > MIRROR_METALLIC and material.roughness < MIRROR_ROUGHNESS


def is_glossy(material: Material) -> bool:
    """Whether the surface shows sharp highlights without being a mirror.

    Glass does not count: what is bright there mostly lies behind it.
    """
    return (
        material.roughness < GLOSSY_ROUGHNESS
        and not is_mirror(material)
        and not is_transparent(material)
    )


def is_transparent(material: Material) -> bool:
    """Whether the background shows more strongly than the surface."""
    return material.is_transparent


def is_thin_glass(material: Material) -> bool:
    """Whether what lies behind the surface shows at its own disparity: nothing bends the rays."""
    return material.is_transparent and not material.bends
