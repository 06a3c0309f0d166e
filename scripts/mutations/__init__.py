"""Faults that the tests of the depth camera have to notice; see `scripts/mutate_sensor.py`."""
