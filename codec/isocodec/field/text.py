"""Text that came from somewhere else, made fit for a terminal."""

from __future__ import annotations


def plain(text: str, keep: str = "") -> str:
    """Text without what a terminal takes for orders: control characters, escapes, changes of direction.

    Parameters
    ----------
    text : str
        From a file, its name, or a library that has read it.
    keep : str
        Characters that may stay although they do not print, such as a line break.

    Returns
    -------
    str
        With the escapes of Python's strings instead of these characters.
    """
    return "".join(c if c.isprintable() or c in keep else c.encode("unicode_escape").decode() for c in text)


def one_line(text: str, most: int = 200) -> str:
    """The beginning of a text in one line, and fit for a terminal."""
    line = plain(" ".join(text.split()))
    return line if len(line) <= most else line[: most - 3] + "..."
