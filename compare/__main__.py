"""``python -m compare`` is the ``compare`` command."""

from compare.cli.app import main

main()
