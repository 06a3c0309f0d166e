"""Shapes and textures of the built-in object, made by code; `procedural.py` assembles them."""
