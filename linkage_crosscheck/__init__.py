"""The way in from Python: ``import linkage_crosscheck as lc``."""
