"""What a person may ask: a frozen type for each question, whose fields are the options of a command and the arguments
of a function.

None of these types imports what computes, so that ``compare --help`` answers at once.
"""
