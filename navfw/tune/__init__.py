"""Tuning of a stack's parameters and of the break points of its rules, by Optuna."""
