"""Benchmarks of the parts: measured against truth or references, given as plain data."""
