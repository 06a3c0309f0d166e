"""The study engine: cases as data, a resumable runner, one JSON line per result, and a report."""
