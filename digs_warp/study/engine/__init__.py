"""The study engine: cases as data, how one is run and scored, and queries on their results."""
