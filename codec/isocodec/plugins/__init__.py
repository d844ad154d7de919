"""Plugins for other programs, a file each: ``isocodec plugins`` lists them. Each imports `isocodec` and its program."""
