"""Pages, tables and figures of the evidence: one module for each kind, found by its name."""
