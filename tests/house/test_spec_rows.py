"""The specification's table of rows is what the codec uses."""

import sys

from home import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import spec_rows


def test_the_specification_states_the_rows_of_all_networks():
    assert spec_rows.main(["--check"]) == 0


def test_another_table_is_noticed(tmp_path, monkeypatch):
    text = spec_rows.SPEC.read_text(encoding="utf-8")
    other = tmp_path / "grids.md"
    other.write_text(text.replace(spec_rows.BEGIN, spec_rows.BEGIN + "| 9 |\n"), encoding="utf-8")
    monkeypatch.setattr(spec_rows, "SPEC", other)
    assert spec_rows.main(["--check"]) == 1
