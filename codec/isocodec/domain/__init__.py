"""Explicit domains: triangulations and tetrahedra that are given, not derived (spec clause 10)."""
