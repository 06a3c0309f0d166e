"""Generators of the built-in object and room: ``python -m builtin_assets`` in scripts/ writes them."""
