"""LOCOM: realises the fused command within the limits of the drive (paper sec 2)."""
