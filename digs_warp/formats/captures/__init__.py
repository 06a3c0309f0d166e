"""Captures in other programs' formats, one file per format: what it looks like, its reader, its writer."""
