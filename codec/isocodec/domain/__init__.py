"""Domains that no lattice gives: points of the plane and their triangulation (spec clause 10)."""
