"""Fields in tiles: each tile is coded independently, and all tiles are in one file (spec clause 12)."""
