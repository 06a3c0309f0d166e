"""The pytest plug-in: other projects' tests on simulated captures at rising sensor noise."""
