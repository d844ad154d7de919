"""The command line: what its verbs write."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails, ok, run
from libraries import Late

Image = Late("PIL.Image")
shapely = Late("shapely")
trimesh = Late("trimesh")

# ---- encode ---------------------------------------------------------------------------------------------------------


def test_encode_tells_what_it_wrote(hills: Path, tmp_path: Path, curve_data: bytes) -> None:
    out = tmp_path / "out.iso"
    line = ok("encode", hills, "-o", out, "--isovalue", 80.5, "--precision", "exact")
    assert out.read_bytes() == curve_data
    layers = len(isocodec.open(curve_data).info.layers)
    assert line.startswith(f"{out}: {len(curve_data):,} bytes, {layers} layers, ")
    record = json.loads(ok("encode", hills, "-o", out, "--isovalue", 80.5, "--precision", "exact", "--json"))
    assert record.pop("seconds") >= 0
    assert record == {
        "output": str(out),
        "bytes": len(curve_data),
        "layers": layers,
        "shape": [33, 41],
        "dtype": "uint8",
        "missing": 0,
        "isovalues": [80.5],
    }


@pytest.mark.parametrize(
    ("options", "keywords"),
    [
        (["--precision", "0.05"], {"precision": 0.05}),
        (["--precision", "signs"], {"precision": "signs"}),
        (["--precision", "signs", "--layers", "4"], {"precision": "signs", "layers": 4}),
        (["--precision", "exact", "--profile", "baseline"], {"precision": "exact", "profile": "baseline"}),
    ],
)
def test_encode_options_are_those_of_the_library(
    hills: Path, tmp_path: Path, options: list[str], keywords: dict[str, Any]
) -> None:
    ok("encode", hills, "-o", tmp_path / "out.iso", "--isovalue", 80.5, *options)
    assert (tmp_path / "out.iso").read_bytes() == isocodec.encode(HILLS, 80.5, **keywords)


def test_negative_isovalue_is_no_option(tmp_path: Path) -> None:
    np.save(tmp_path / "n.npy", HILLS.astype(np.int16) - 100)
    ok("encode", tmp_path / "n.npy", "-o", tmp_path / "n.iso", "--isovalue", "-19.5")
    assert isocodec.open(tmp_path / "n.iso").info.isovalue == -19.5


def test_usage_errors_are_one_line_too(hills: Path) -> None:
    assert "--isovalue" in fails(2, "encode", hills, "-o", "x.iso")
    assert "'isocodec encode --help'" in fails(2, "encode", "--nonsense")
    assert "nonsense" in fails(2, "nonsense")
    assert "'isocodec decode --help'" in fails(2, "decode", hills, "--areas")
    assert "not a valid float" in fails(2, "encode", hills, "-o", "x.iso", "--isovalue", "high")


@pytest.mark.parametrize("name", ["a.png", "a.NII.gz", "a.geojson", "a.npy"])
def test_files_do_not_go_under_the_name_of_another_format(hills: Path, curve: Path, tmp_path: Path, name: str) -> None:
    """Contours of a field are written in formats that hold them; an edited file is an .iso file."""
    assert "in .iso" in fails(2, "edit", curve, "--layers", 1, "-o", tmp_path / name)
    if name in ("a.NII.gz", "a.npy"):
        assert "cannot hold a contour" in fails(2, "encode", hills, "--isovalue", 80.5, "-o", tmp_path / name)
    assert not (tmp_path / name).exists()


def unreadable_fields(folder: Path) -> dict[str, Sequence[str]]:
    """Names of bad inputs, each with words that its message must contain."""
    (folder / "text.npy").write_text("1 2 3\n4 5 6\n")
    (folder / "empty.npy").touch()
    np.save(folder / "strings.npy", np.array([["a", "b"], ["c", "d"]]))
    np.save(folder / "objects.npy", np.array([[None, {}]], dtype=object), allow_pickle=True)
    np.save(folder / "complex.npy", np.ones((3, 3), dtype=complex))
    np.savez(folder / "several.npz", a=HILLS, b=HILLS)
    Image.fromarray(np.dstack([HILLS] * 3)).save(folder / "colour.png")
    (folder / "table.csv").write_text("1,2\n")
    (folder / "directory.npy").mkdir()
    np.save(folder / "holes.npy", np.full(HILLS.shape, np.nan))
    np.save(folder / "scalar.npy", np.float64(3))
    return {
        "missing.npy": ["No such file"],
        "directory.npy": ["holds no samples"],
        "text.npy": ["not a NumPy file"],
        "empty.npy": ["not a NumPy file"],
        "strings.npy": ["strings"],
        "objects.npy": ["Python objects"],
        "complex.npy": ["complex"],
        "several.npz": ["2 arrays: a, b", "--key"],
        "colour.png": ["3 channels", "--band"],
        "table.csv": ["columns"],
        "holes.npy": ["all samples are missing"],
        "scalar.npy": [],
    }


def test_fields_that_cannot_be_encoded(tmp_path: Path) -> None:
    out = tmp_path / "out.iso"
    for name, words in unreadable_fields(tmp_path).items():
        line = fails(3, "encode", tmp_path / name, "-o", out, "--isovalue", 80.5)
        assert line.startswith(f"isocodec: {tmp_path / name}: ")
        for word in words:
            assert word in line
        assert not out.exists()


def test_missing_extra(tmp_path: Path, surface: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Image.fromarray(HILLS).save(tmp_path / "a.png")
    for module in ("PIL", "trimesh", "matplotlib.figure"):
        monkeypatch.setitem(sys.modules, module, None)
    line = fails(7, "encode", tmp_path / "a.png", "-o", tmp_path / "a.iso", "--isovalue", 1)
    assert line.endswith("reading pictures needs PIL: pip install 'isocodec[pictures]'")
    assert "'isocodec[mesh]'" in fails(7, "decode", surface, "-o", tmp_path / "a.ply")
    assert "'isocodec[plot]'" in fails(7, "decode", surface, "-o", tmp_path / "s.png")
    # before any work: the file is not even looked at
    surface.write_bytes(b"no curve")
    for out, *verb in (("s.png", "plot"), ("s.png", "plot", "--map")):
        fails(7, *verb, surface, "-o", tmp_path / out)


# ---- decode ---------------------------------------------------------------------------------------------------------


def test_decode_curves(curve: Path, tmp_path: Path, curve_data: bytes) -> None:
    contour = isocodec.decode(curve_data)
    line = ok("decode", curve, "-o", tmp_path / "c.npz")
    assert f"{len(contour.points):,} points, {len(contour.cells):,} segments" in line
    with np.load(tmp_path / "c.npz") as arrays:
        assert np.array_equal(arrays["points"], contour.points)
        assert np.array_equal(arrays["cells"], contour.cells)
    ok("decode", curve, "-o", tmp_path / "c.geojson")
    feature = json.loads((tmp_path / "c.geojson").read_text())
    lines = [shapely.geometry.shape(one["geometry"]) for one in feature["features"]]
    assert len(lines) == 2  # one ring around each hill
    assert all(line.is_ring for line in lines)
    ok("decode", curve, "-o", tmp_path / "c.svg")
    assert (tmp_path / "c.svg").read_text().count("<path") >= 2
    ok("decode", curve, "-o", tmp_path / "c.png")
    assert Image.open(tmp_path / "c.png").size[0] == 900


def test_decode_of_the_wrong_dimension(curve: Path, surface: Path, tmp_path: Path) -> None:
    line = fails(2, "decode", curve, "-o", tmp_path / "c.stl")
    assert line.startswith(f"isocodec: {tmp_path / 'c.stl'}: ")
    assert ".geojson" in line and ".png" in line
    assert ".npz" in fails(2, "decode", surface, "-o", tmp_path / "s.svg")
    assert ".geojson" in fails(2, "decode", surface, "-o", tmp_path / "s.xyz")


def test_decode_of_an_empty_curve(tmp_path: Path) -> None:
    (tmp_path / "e.iso").write_bytes(isocodec.encode(HILLS, 300.5))
    for suffix in (".npz", ".geojson", ".svg", ".png"):
        ok("decode", tmp_path / "e.iso", "-o", tmp_path / f"e{suffix}")
    assert json.loads((tmp_path / "e.geojson").read_text())["features"] == []


# ---- info, truncate, plot -------------------------------------------------------------------------------------------


def test_info(curve: Path, curve_data: bytes) -> None:
    info = isocodec.open(curve_data).info
    shown = ok("info", curve)
    for words in ("33 x 41", "80.5", f"{len(curve_data):,}", "main", "base", "values"):
        assert words in shown
    assert json.loads(ok("info", curve, "--json")) == json.loads(
        json.dumps({**info.as_dict(), "promise": "all values exactly"})
    )


def test_metadata_goes_into_the_file(hills: Path, tmp_path: Path) -> None:
    out = tmp_path / "m.iso"
    ok("encode", hills, "-o", out, "--isovalue", 80.5, "--metadata", "unit=m=1", "--metadata", "[red]source=")
    assert isocodec.open(out.read_bytes()).info.metadata == {"unit": "m=1", "[red]source": ""}
    shown = ok("info", out)
    assert "[red]source" in shown and "m=1" in shown
    for wrong in (["unit"], ["=m"], ["unit=m", "--metadata", "unit=km"]):
        assert "KEY=TEXT" in fails(2, "encode", hills, "-o", out, "--isovalue", 80.5, "--metadata", *wrong)


def test_info_says_why_sizes_of_layers_are_missing(curve: Path, curve_data: bytes) -> None:
    assert "too small" in ok("info", curve)
    curve.write_bytes(curve_data[:-30])
    shown = run("info", curve).stdout
    assert "too small" not in shown and "no index of its layers, or not all of it" in " ".join(shown.split())


def test_warning_where_nothing_of_the_curve_has_come(curve: Path, curve_data: bytes, tmp_path: Path) -> None:
    result = run("decode", curve, "-o", tmp_path / "c.npz", "--max-bytes", 14)
    assert result.exit_code == 0 and "does not reach the curve" in result.stderr


def test_layers_before_damage_are_decoded(curve_data: bytes, tmp_path: Path) -> None:
    path, out = tmp_path / "damaged.iso", tmp_path / "out.npz"
    path.write_bytes(curve_data[:-1] + bytes([curve_data[-1] ^ 1]))
    assert "checksum" in fails(4, "decode", path, "-o", out)
    ok("decode", path, "-o", out, "--layers", 2)
    with np.load(out) as arrays:
        assert np.array_equal(arrays["points"], isocodec.decode(curve_data, layers=2).points)


def test_info_shows_strange_names_as_they_are(tmp_path: Path, curve_data: bytes) -> None:
    path = tmp_path / "[red]curve.iso"
    path.write_bytes(curve_data)
    assert "[red]curve.iso" in ok("info", path).replace("\n", "")


def test_info_loads_no_compiler(curve: Path) -> None:
    code = (
        "import sys\n"
        "from isocodec.cli import main\n"
        "try: main(['info', sys.argv[1]])\n"
        "except SystemExit as end: assert end.code == 0\n"
        "heavy = {'numba', 'llvmlite', 'matplotlib', 'rich', 'scipy', 'trimesh'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(curve)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


def test_truncate(curve: Path, tmp_path: Path, curve_data: bytes) -> None:
    out = tmp_path / "t.iso"
    record = json.loads(ok("edit", curve, "-o", out, "--layers", 2, "--json"))
    assert out.read_bytes() == isocodec.open(curve_data).edited(layers=2)
    assert record == {
        "output": str(out),
        "bytes": out.stat().st_size,
        "input_bytes": len(curve_data),
        "isovalues": [80.5],
        "layers": 2,
        "input_layers": len(isocodec.open(curve_data).info.layers),
    }
    size = len(curve_data) * 3 // 4
    line = ok("edit", curve, "-o", out, "--size", size)
    assert out.stat().st_size <= size
    there, kept = (len(isocodec.open(each).info.layers) for each in (curve, out))
    assert f" of {len(curve_data):,} bytes, {kept} of {there} layers" in line and 0 < kept < there
    ok("decode", out, "-o", tmp_path / "t.npz")


def test_plot(curve: Path, surface: Path, tmp_path: Path, curve_data: bytes) -> None:
    steps = min(3, len(isocodec.open(curve_data).info.layers))
    assert f"{steps} steps" in ok("plot", curve, "-o", tmp_path / "c.png", "--steps", 3)
    assert Image.open(tmp_path / "c.png").width == pytest.approx(steps * 2.6 * 150, abs=2)
    ok("plot", surface, "-o", tmp_path / "s.png")
    assert Image.open(tmp_path / "s.png").format == "PNG"
    assert ".png, .pdf, .svg" in fails(2, "plot", curve, "-o", tmp_path / "c.stl")
