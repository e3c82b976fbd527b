"""Exudyn: driven runs, static equilibria, beams and export of a script."""
