"""Shapes and textures of the built-in object, made by code; `digs_warp.sim.procedural` assembles them."""
