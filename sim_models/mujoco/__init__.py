"""MuJoCo: driven runs, static equilibria and export of its own model."""
