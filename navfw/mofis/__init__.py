"""MOFIS: primitive behaviours, the short-term ego map, and fuzzy command fusion (paper sec 2)."""
