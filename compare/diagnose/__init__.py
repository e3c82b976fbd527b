"""``compare diagnose``: where simulation and measurement disagree, and which missing effect explains it."""
