"""How far numbers can be trusted: bands of predictions and numerical uncertainties, held against what is known."""
