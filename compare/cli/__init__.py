"""The ``compare`` command: each module is one subcommand, thin over the functions that do the work."""
