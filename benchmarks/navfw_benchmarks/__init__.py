"""Benchmarks of navfw, the experiments of its paper, and variants of its parts to compare with."""
