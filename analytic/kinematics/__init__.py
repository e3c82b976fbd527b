"""Structure, loop closure, assembly and motion of a planar linkage."""
