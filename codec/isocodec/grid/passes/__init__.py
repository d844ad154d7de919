"""The passes over the mesh, each written once for both directions (spec clause 5)."""
