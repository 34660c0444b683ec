"""``python -m navfw``: the same as the console script."""

from __future__ import annotations

from navfw.cli import main

main()
