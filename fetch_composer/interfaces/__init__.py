"""Faces of the environments for libraries other than dm_env; each needs an optional extra."""
