"""Measured results as JSON files, one each, and the page that is written from them."""
