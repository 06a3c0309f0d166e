"""What the arrays of every `digs_warp.sim.scene.scene.Scene` have to be."""

import numpy as np

from digs_warp.sim.scene.scene import Scene


def check_arrays(scene: Scene) -> None:
    """Shapes, number types, and finite values."""
    n, m = len(scene.vertices), len(scene.faces)
    for array, shape, dtype in (
        (scene.vertices, (n, 3), np.float32),
        (scene.faces, (m, 3), np.int32),
        (scene.face_materials, (m,), np.int32),
        (scene.normals, (n, 3), np.float32),
        (scene.uvs, (n, 2), np.float32),
        (scene.vertex_colors, (n, 3), np.float32),
    ):
        assert array.shape == shape
        assert array.dtype == dtype
        assert np.isfinite(array).all()
