"""DART: skeletons closed by its own constraints, journals and bearings for its own contact solver."""
