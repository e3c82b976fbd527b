"""How a run is driven, whichever engine makes it."""
