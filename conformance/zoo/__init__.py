"""A zoo of wrong decoders: deliberate misreadings of the specification, each planted in a copy of our decoder.

It belongs to the development of this repository, not to the public package ``isoconform``: what it changes are our own
sources, text by text. Decoders in other languages profit by what comes of it: each misreading has a vector that
catches it (``misreadings.md``).
"""
