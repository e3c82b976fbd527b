"""What the data make of every set of effects: prior, compressed problem, search over sets, refits of the best."""
