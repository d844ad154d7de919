"""Pictures of curves and surfaces: for files, for notebooks, contour maps."""
