"""The base of every fault that is foreseen.  It imports nothing, so that the command's help is quick."""


class Error(Exception):
    """Base of every fault that is foreseen; its message is one sentence that says what is wrong and what to do.

    Each is a ValueError too, or a RuntimeError where a simulator is missing or fails.
    """
