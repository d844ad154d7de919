"""State of one isovalue while it is coded: vertices, leaves, marks of the mesh (spec clause 5.1)."""
