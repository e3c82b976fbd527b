"""Effects: what a model may lack, each a name, places and pure functions."""
