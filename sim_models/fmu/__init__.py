"""Somebody's FMU (FMI 2.0 or 3.0, co-simulation) as a simulator: what it says of itself, its map, and its run."""
