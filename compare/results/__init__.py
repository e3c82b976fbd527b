"""What the commands answer: one frozen model for each document, from which its JSON Schema file is generated."""
