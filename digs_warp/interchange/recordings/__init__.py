"""Recordings of real RGB-D cameras, in the folders that other programs write -> capture folders."""
