"""Pictures of contours by matplotlib and PyVista: files, notebooks, steps side by side, contour maps."""
