"""Scripts that run an exported linkage in its engine without this project, as they are written into an export."""
