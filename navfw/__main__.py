"""``python -m navfw``: the ``navfw`` command."""

from __future__ import annotations

from navfw.cli import main

main()
