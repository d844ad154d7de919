"""A widget for notebooks that draws a file while its bytes arrive: anywidget, and ``widget.js`` of the npm package."""

from __future__ import annotations

import os
from base64 import b64encode
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import anywidget

from isospec.tables import shipped

from ..errors import IsoError
from ..storage.ranges import ranges_of

SOURCE = "ISOCODEC_WIDGET"
"""Environment variable: path or URL of another ``widget.js``, where pages cannot load that of jsdelivr.net."""
_ESM = """
export default {
  async render({ model, el }) {
    try {
      return (await import("%s")).default.render({ model, el });
    } catch (error) {
      el.textContent = `widget.js cannot be used (${error.message}): see ISOCODEC_WIDGET`;
      model.on("msg:custom", ({ picture }) => picture && (el.innerHTML = picture));
      model.send({ picture: true });
    }
  },
};
"""


def module() -> str:
    """Address of ``widget.js``, of the version that is installed; a file of `SOURCE` is part of the address."""
    if source := os.environ.get(SOURCE):
        if source.startswith(("http://", "https://")):
            return source
        return f"data:text/javascript;base64,{b64encode(Path(source).read_bytes()).decode()}"
    try:
        installed = f"@{version('isocodec')}"
    except PackageNotFoundError:
        installed = ""
    return f"https://cdn.jsdelivr.net/npm/isocodec{installed}/dist/widget.js"


class Widget(anywidget.AnyWidget):
    """A file, drawn while its bytes arrive.

    Parameters
    ----------
    source : path, URL, bytes, or callable
        Where ranges are read when the page asks for them; a callable returns the bytes from one offset up to another,
        fewer if the file ends before.
    picture : callable, optional
        Returns HTML to show where the page cannot load ``widget.js``.

    Raises
    ------
    OSError, MissingExtraError
        If it cannot be opened.
    """

    def __init__(self, source: Any, picture: Callable[[], str] | None = None) -> None:
        fetch = None if callable(source) else ranges_of(source)
        self._read = source if fetch is None else lambda start, end: fetch([(start, end)])[0]
        self._picture = picture
        super().__init__(_esm=_ESM % module())
        self.on_msg(self._answer)

    def _answer(self, _: Any, asked: dict[str, Any], __: Any) -> None:
        """Send what the page asks for: a range of the file, the tables of the profile ``main``, or a picture."""
        if "picture" in asked:
            if self._picture is not None:
                self.send({"picture": self._picture()})
            return
        try:
            data = shipped() if "tables" in asked else self._read(asked["start"], asked["end"])
        except (IsoError, OSError) as error:
            self.send({"id": asked["id"], "error": str(error)})
        else:
            self.send({"id": asked["id"]}, [data])
