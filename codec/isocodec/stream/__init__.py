"""Files: container, layer programs, incremental encoder and decoder (spec clauses 3 and 8)."""
