"""Fields in tiles: each tile coded on its own, all of them in one file (spec clause 12)."""
