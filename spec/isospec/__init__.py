"""The machine-readable half of the specification: container declarations and normative tables.

Light to import: neither numba nor the codec is needed to read a file's structure.
"""
