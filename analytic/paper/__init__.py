"""What the paper derives: kinetostatics (Eqs. 9-14), clearance (8), compliance (1-7), their superposition and the
accuracy that it gives.
"""
