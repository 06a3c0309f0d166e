"""The commands of `digs-warp`: one dataclass each, whose fields are its flags and `execute` its verb."""
