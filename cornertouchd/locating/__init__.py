"""Column of a picture -> directing line on the surface, one module per method."""
