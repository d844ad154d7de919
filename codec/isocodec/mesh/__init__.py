"""Explicit meshes: complexes, walks, levels and meshes in files."""
