"""Domains that no lattice gives: meshes, points of the plane and their triangulation (spec clause 10)."""
