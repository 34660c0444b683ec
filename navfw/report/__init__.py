"""Reports of runs and suites: one HTML file each, which needs no network."""
