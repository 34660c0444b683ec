"""Behaviours of other packages, wrapped as plugins to compare with; each is told the truth."""
