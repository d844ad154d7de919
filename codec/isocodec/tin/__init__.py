"""Triangulated surfaces: Delaunay triangulations, thinning, coded points."""
