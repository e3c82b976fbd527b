"""Tests; ``evidence``, what the project says of itself; and benchmarks."""
