"""Probability models: what is seen around a symbol, and the contexts it is coded in (spec clause 7)."""
