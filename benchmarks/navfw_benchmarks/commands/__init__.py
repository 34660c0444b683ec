"""The commands ``navfw bench``, ``results`` and ``reproduce``."""
