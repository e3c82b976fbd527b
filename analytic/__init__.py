"""What the paper derives: kinematics, kinetostatics, clearance and compliance of planar linkages; no engine."""
