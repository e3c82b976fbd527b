"""Sets of data as unkind as a bench: five families, each in a file of its own, and what they share.

:mod:`rig` draws linkages, runs and the small errors of a rig, and has an engine play it; :mod:`sensors` is what
sensors, amplifiers, encoders and clocks make of it, written anew from the contract; :mod:`sigmas` says how well an
effect shows; :mod:`written` writes the files and the seal.
"""
