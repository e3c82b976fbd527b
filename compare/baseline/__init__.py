"""``compare baseline``: reaction forces stored to be reviewed, and whatever has moved since."""
