"""The pictures of the papers anew (see `__main__`)."""
