"""Benchmarks of single parts against ground truth or a reference; results are plain data."""
