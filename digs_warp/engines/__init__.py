"""Many independent calls, such as scenes or the cases of a study, on an engine: processes, Dask, Slurm."""
