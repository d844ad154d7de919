"""Bytes and records: header, chunks, programs of layers (spec clause 3). Knows no kernels."""
