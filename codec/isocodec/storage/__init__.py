"""Where bytes are: files, URLs, ranges of both, atomic writing."""
