"""What PyBullet and DART share: planar bodies, joint laws, runs and equilibria over an engine that takes plain
steps.
"""
