"""``compare validity``: over speed and clearance, where the analytic model holds."""
