"""The specification's figures are those that its script draws, and the text shows each."""

import re
import sys
from xml.etree import ElementTree

import pytest

from home import ROOT

pytest.importorskip("matplotlib")
sys.path.insert(0, str(ROOT / "tools"))

import spec_figures

MOST = 60_000
"""Bytes of a figure."""


def words(figure):
    """What a figure says: other versions of matplotlib write other lines."""
    return [text.text for text in ElementTree.parse(figure).iter("{http://www.w3.org/2000/svg}text")]


@pytest.mark.heavy  # matplotlib, seven figures
def test_figures_are_up_to_date(tmp_path):
    spec_figures.main(tmp_path)
    drawn = sorted(tmp_path.iterdir())
    assert [path.name for path in drawn] == sorted(path.name for path in spec_figures.FOLDER.iterdir())
    for path in drawn:
        kept = spec_figures.FOLDER / path.name
        assert words(path) == words(kept) and kept.stat().st_size < MOST, "python tools/spec_figures.py draws them anew"


def test_the_text_shows_each_figure_once():
    text = (ROOT / "spec" / "grids.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^!\[.+\]\(figures/(\w+)\.svg\)$", text, re.MULTILINE)) == sorted(spec_figures.FIGURES)
