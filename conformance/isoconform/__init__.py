"""Conformance of decoders of ``.iso`` files: vectors, what they decode to, and a runner for any decoder.

``python -m isoconform`` runs the reference decoder, or one given as a command, over all vectors; ``python -m isoconform
dump FILE`` is the protocol that such a command follows; ``fuzz`` holds it against the reference on files made from the
syntax, ``explain FILE`` shows bytes and symbols, ``generate DIR`` writes the vectors anew. What a decoder must agree on
are the integers of annex B of the specification, never drawings.
"""
