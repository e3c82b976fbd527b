"""Analytic reference, tolerances, discrepancies, and which party stands apart."""
