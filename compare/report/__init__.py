"""Pages, tables and figures: one module for each document, found by its name.  They take results and nothing else."""
