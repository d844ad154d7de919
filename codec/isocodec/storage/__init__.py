"""Sources and targets of bytes: files, URLs, ranges of both, atomic writing."""
