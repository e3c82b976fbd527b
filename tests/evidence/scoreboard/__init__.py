"""How well a diagnosis does on data whose truth it has not seen: hidden sets, their scores, and the board of all of
them.
"""
