"""Measured data: what a bench recorded, read, checked and thinned."""
