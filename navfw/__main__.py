"""``python -m navfw``: the ``navfw`` command."""

from navfw.cli import main

main()
