"""Before any data exist: which runs and which sensors would tell what a model lacks."""
