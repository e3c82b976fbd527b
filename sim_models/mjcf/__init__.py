"""Somebody's own MJCF file: read as a planar linkage, turned into a mechanism, and run as it is."""
