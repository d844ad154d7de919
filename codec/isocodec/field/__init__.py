"""Sampled fields: checks, signs, and the numbers that geometry codes (spec clause 2)."""
