"""MOFIS: primitive behaviours and fuzzy command fusion (paper sec 2)."""
