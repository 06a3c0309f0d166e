"""Turns a mesh file into the arrays of a `Scene`; start at `../load.py`."""
