"""Sources and targets of bytes: files, URLs, byte ranges, atomic writing."""
