"""A cheap look at a capture before any work: do depth, poses, focal length and masks fit together?

Nothing here changes a result. A finding names the likely cause, so that a wrong unit or convention is found
in a second instead of after a training.
"""
