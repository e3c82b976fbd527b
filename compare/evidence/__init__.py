"""Evidence that is stored, made again and compared: baselines, validation, scoreboard."""
