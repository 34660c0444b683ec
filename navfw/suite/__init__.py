"""Evaluation: worlds x missions x seeds in worker processes, one table, one summary."""
