"""The widget of notebooks: what it answers to a page, which `tools/viewer/widget.test.mjs` tests."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import BALL, HILLS
from home import ROOT
from isocodec.api import isofile
from isospec.tables import shipped
from libraries import Late

fsspec = Late("fsspec")
VIEW = "application/vnd.jupyter.widget-view+json"
FILES = {
    "whole": (HILLS, [40.5, 80.5], {"precision": "exact"}), "surface": (BALL, 55.5, {}),
    "noise": (np.random.default_rng(1).integers(0, 9, (150, 150)), 4.5, {"precision": "exact"}),
    "tiles": (HILLS, 80.5, {"tile": 32}),
}


class Page:
    """Asks a widget as a page does; `sent` is what came."""

    def __init__(self, widget: Any) -> None:
        self.widget, self.sent = widget, list[tuple[dict[str, Any], list[bytes]]]()
        widget.send = lambda content, buffers=(): self.sent.append((content, [*buffers]))

    def ask(self, **what: Any) -> tuple[dict[str, Any], list[bytes]]:
        self.widget._handle_custom_msg({"id": 7, **what}, [])
        return self.sent.pop()

    def whole(self) -> bytes:
        """The file, piece by piece, each after the first with the last byte of the one before."""
        found, end = b"", 4096
        while True:
            content, (piece,) = self.ask(start=max(len(found) - 1, 0), end=end)
            assert content == {"id": 7} and piece[: len(found) > 0] == found[-1:]
            found += piece[len(found) > 0 :]
            if len(found) < end:
                return found
            end *= 2


@pytest.fixture(params=FILES)
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    field, isovalue, options = FILES[request.param]
    isocodec.save(tmp_path / "some.iso", field, isovalue, **options)
    return tmp_path / "some.iso"


def test_pieces_of_files_of_paths_and_of_stores(path: Path) -> None:
    pytest.importorskip("anywidget")
    from isocodec.plotting.widget import Widget

    data, file = path.read_bytes(), isocodec.open(path)
    with fsspec.open("memory://maps/some.iso", "wb") as there:
        there.write(data)
    file._repr_mimebundle_()
    for widget in (file._widget, Widget(path), Widget("memory://maps/some.iso"), Widget(data)):
        page = Page(widget)
        assert page.whole() == data
        assert page.ask(tables=True) == ({"id": 7}, [shipped()])
    assert "<img" in Page(file._widget).ask(picture=True)[0]["picture"]
    page = Page(Widget(path))
    path.unlink()
    assert "No such file" in page.ask(start=0, end=9)[0]["error"]


def test_notebooks_show_a_widget_or_a_picture(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a widget nothing is decoded; the same one is shown again."""
    pytest.importorskip("anywidget")
    file = isocodec.open(path)
    monkeypatch.setattr(type(file), "contour", None)
    data, _ = file._repr_mimebundle_(include=None)
    assert data[VIEW]["model_id"] == file._widget.model_id == file._repr_mimebundle_()[0][VIEW]["model_id"]
    assert data["text/plain"] == repr(file) and "isovalue" in data["text/html"] and "<img" not in data["text/html"]
    monkeypatch.setattr(isofile, "find_spec", lambda name: None)
    assert file._repr_mimebundle_() is None


def test_where_the_module_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("anywidget")
    from isocodec.plotting.widget import SOURCE, Widget, module

    monkeypatch.delenv(SOURCE, raising=False)
    package = json.loads((ROOT / "codec/js/package.json").read_text())
    assert package["version"] == isocodec.__version__ and package["exports"]["./widget"] == "./dist/widget.js"
    assert module().startswith("https://cdn.jsdelivr.net/npm/isocodec") and module().endswith("/dist/widget.js")
    (tmp_path / "widget.js").write_text("export default {}")
    monkeypatch.setenv(SOURCE, str(tmp_path / "widget.js"))
    kind, text = module().split(",")
    assert kind == "data:text/javascript;base64" and base64.b64decode(text) == b"export default {}"
    assert module() in Widget(b"")._esm
    monkeypatch.setenv(SOURCE, "https://example.org/widget.js")
    assert module() == "https://example.org/widget.js"
