"""Whole files: container, layer programs, incremental encoders and decoders (spec clauses 3 and 8)."""
