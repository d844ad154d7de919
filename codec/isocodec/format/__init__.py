"""Conversion between bytes and records: header, chunks, layer programs (spec clause 3); uses no kernels."""
