"""Models of the depth sensor, from a closed-form law to real matching."""
