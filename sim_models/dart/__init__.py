"""DART: skeletons closed by constraints, with contact laws of ours."""
