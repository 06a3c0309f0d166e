"""Captures in other programs' formats; nerfstudio reads the capture folder as it is."""
