"""Geometry of a turning camera: rotations, image points turned by them, flow without them."""
