"""Variants of navfw's parts that serve to compare, as plugins."""
