"""Files that somebody else wrote: what a logger recorded, or another program computed."""
