"""A place and a law for what has no name: one unknown at one place, solved for at every sample, and what it looks like.

:mod:`places` says what one unknown number can be; :mod:`scene` where these data would show one, and how the sensors
answer to it; :mod:`laws` what it may depend on; :mod:`regression` finds the few laws that tell it; :mod:`proposal` puts
them together.
"""
