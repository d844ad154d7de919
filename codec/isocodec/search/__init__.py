"""Reduction of the finest mesh under criteria, and the distance that it costs (rows C2-reduce, S3-distortion)."""
