"""Studies and benchmarks: cases as data, a runner, tables."""
