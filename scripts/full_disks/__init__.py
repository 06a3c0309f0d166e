"""Commands on disks that run full."""
