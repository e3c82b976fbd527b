"""PyBullet: multibody trees closed by constraints of ours, and export as URDF."""
