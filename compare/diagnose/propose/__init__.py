"""A place and a law for what has no name: one unknown at one place, solved for at every sample, and what it looks like.

:mod:`places` says where one unknown number can be and how the sensors answer to it; :mod:`laws` what it may depend on;
:mod:`regression` finds the few laws that tell it; :mod:`proposal` puts them together.
"""
