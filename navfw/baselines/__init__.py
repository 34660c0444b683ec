"""Behaviours of other packages, wrapped as plugins to compare with; with the simulator's truth."""
