"""PyBullet: multibody trees closed by its point constraints, static contact by struts, and export as URDF."""
