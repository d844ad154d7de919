"""Sampled fields: checks, signs, the numbers that geometry sends (spec clause 2)."""
