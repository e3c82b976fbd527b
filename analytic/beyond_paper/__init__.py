"""What the paper leaves out: drives that yield, free motion, tolerances by Monte Carlo."""
