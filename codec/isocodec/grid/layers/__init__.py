"""The layers of one isovalue, written and read (spec clauses 3.6, 6.1)."""
