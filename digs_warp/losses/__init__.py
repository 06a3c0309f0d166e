"""The terms of the training loss (paper section 3.4, and what objects and depth sensors add)."""
