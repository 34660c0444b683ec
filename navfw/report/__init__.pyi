from .run_moments import read_moments as read_moments
