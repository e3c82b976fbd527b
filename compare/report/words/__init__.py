"""Every sentence that a person reads on a page or a terminal: one module for each kind of thing that is said.

What a document stores as a sentence is filled in from here too, by the module that makes the document, and by nothing
else: results hold facts, and what computes, judges or diagnoses says nothing itself.
"""
