"""Help for testing a robot: missions as pytest tests, a check for behaviours, fakes."""
