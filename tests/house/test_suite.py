"""The suite itself: what its modules load, what it leaves out of tables, files that it keeps."""

from __future__ import annotations

import ast
import re
import sys
from itertools import combinations, product

import pytest

from home import ROOT

sys.path.insert(0, str(ROOT / "tools"))

import slips
from heavy_changed import SOURCES
from tables import covering, looped

HEADS = {
    "PIL", "SimpleITK", "aiohttp", "antimeridian", "cfgrib", "contourpy", "dask", "distributed", "ezdxf", "fsspec",
    "geopandas", "h5py", "highdicom", "imagecodecs", "imageio", "laspy", "lxml", "mapbox_vector_tile", "matplotlib",
    "meshio", "netCDF4", "networkx", "nibabel", "numba", "pandas", "pmtiles", "pyarrow", "pydicom", "pyogrio", "pyproj",
    "pyvista", "rasterio", "rioxarray", "scipy", "shapely", "skimage", "tifffile", "trimesh", "vtk", "xarray", "zarr",
}
"""Libraries that take a tenth of a second and more to load, in every process that collects tests."""


def test_slips_fit_the_sources_and_name_tests_that_there_are() -> None:
    for slip in slips.slips_of(slips.LIST, ROOT / "codec" / "isocodec"):
        assert slips.tests_of(slip, ROOT)


def test_modules_of_heavy_tests_have_their_sources_listed() -> None:
    """Nothing runs them else."""
    modules = {path.stem: path.read_text() for path in (ROOT / "tests").rglob("test_*.py")}
    whole = re.compile(r"^pytestmark = \[?\s*pytest\.mark\.heavy", re.MULTILINE)
    heavy = {name for name, text in modules.items() if whole.search(text)}
    assert heavy <= {*SOURCES} <= {*modules}


def test_no_library_is_loaded_by_a_head() -> None:
    """`Late` stands in for it until it is used."""
    found = []
    for path in sorted({*(ROOT / "tests").rglob("*.py")} - {*(ROOT / "tests/apps/scripts").iterdir()}):
        for node in ast.parse(path.read_text()).body:
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [f"{path.name}: {name}" for name in names if name.partition(".")[0] in HEADS]
    assert found == []


@looped("strength", [1, 2])
def test_rows_that_cover_a_table(strength: int) -> None:
    """All that columns have together anywhere, in far fewer rows, also of tables that lack some."""
    rows = [row for row in product(range(4), range(3), range(5), range(2)) if sum(row) % 7]
    some = [rows[number] for number in covering(rows, strength)]

    def together(of: list[tuple[int, ...]]) -> set[object]:
        return {each for row in of for each in combinations(enumerate(row), strength)}

    assert together(some) == together(rows) and len(some) < 30 < len(rows)


def test_rows_in_one_test_name_the_case_that_fails() -> None:
    seen = []

    @looped("a, b", [(1, 2), pytest.param(3, 4, marks=pytest.mark.heavy, id="x"), (5, 6)])
    def table(more: str, a: int, b: int) -> None:
        seen.append((more, a, b))
        assert a < 5

    with pytest.raises(AssertionError) as caught:
        table(more="c")
    assert caught.value.__notes__ == ["in the case of {'a': 5, 'b': 6}"]
    assert seen[0] == ("c", 1, 2) and seen[-1] == ("c", 5, 6)
