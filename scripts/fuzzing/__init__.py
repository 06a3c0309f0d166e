"""The parts of ``scripts/fuzz.py``: damaged inputs for every reader of the package."""
