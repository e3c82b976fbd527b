"""What the engines share without weakening each other: the units that they are run in, and what must be true of every
run.
"""
