"""The report of a reconstruction: one self-contained HTML file."""
