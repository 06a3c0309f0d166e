"""What a glTF file asks for that is not drawn, in a sentence each."""

from collections.abc import Iterator
from typing import Any

from digs_warp.sim.scene.mesh.gltf_uvs import map_places

# Extensions that a file may require because they are read, or change nothing that is drawn here.
READ_EXTENSIONS = {
    *("KHR_mesh_quantization", "KHR_texture_transform", "EXT_texture_webp", "KHR_lights_punctual"),
    *("KHR_materials_clearcoat", "KHR_materials_emissive_strength", "KHR_materials_ior"),
    *("KHR_materials_pbrSpecularGlossiness", "KHR_materials_sheen", "KHR_materials_specular"),
    *("KHR_materials_transmission", "KHR_materials_unlit", "KHR_materials_volume"),
    "KHR_materials_variants",
}


def unmodeled_features(header: dict[str, Any]) -> Iterator[str]:
    """Yield a sentence for all that will look different from what its author intended."""
    for index, material in enumerate(header.get("materials", [])):
        if len(map_places(material)) > 1:
            label = f"material '{material.get('name', index)}'"
            yield f"{label}: its maps lie in different places, drawn where its first one lies"
    for extension in sorted({*header.get("extensionsRequired", [])} - READ_EXTENSIONS):
        yield f"it requires {extension}, which is not read; it may look different"
    shown = [*header.get("nodes", []), *header.get("meshes", [])]
    if any(weight for entry in shown for weight in entry.get("weights", [])):
        yield "morph targets are not read; drawn in its basic shape"
