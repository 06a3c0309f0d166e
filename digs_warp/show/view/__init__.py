"""Interactive pages in the browser: what a file or folder holds, in 3D."""
