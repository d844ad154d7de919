"""Readers and writers of other people's formats: fields in, curves and surfaces out."""
