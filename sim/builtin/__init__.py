"""Shapes and surfaces of the built-in object, made by code; `sim.procedural` puts them together."""
