"""navfw."""
