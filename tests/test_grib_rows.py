"""The order of points in GRIB: rows that turn, projected grids, where GDAL says where they lie; Gaussian ones."""

from __future__ import annotations

import itertools
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import rasterio

EVERY = [*itertools.product((0, 1), repeat=4)]
"""Whether points scan to the west, to the north, columns first, and turn at the end of each row."""
GRIDS = [(kind, *mode) for kind in ("regular_ll", "lambert", "polar_stereographic", "mercator") for mode in EVERY]
GRIDS += [("regular_gg", 0, 0, 0, 0), ("reduced_gg", 0, 0, 0, 0), ("sh", 0, 0, 0, 0)]
OF_GRIB = """
import json, os, sys
import eccodes, numpy as np
from pathlib import Path
from isocodec.errors import InputError
from isocodec.io.readers.from_xarray import _LabelledFile
from isocodec.io.readers.opened import Choice
from isocodec.io.readers.source import InputFile
SAMPLES = {"regular_gg": "regular_gg_pl_grib2", "reduced_gg": "reduced_gg_pl_32_grib2", "sh": "sh_ml_grib2"}
out = []
for number, (kind, west, north, columns, turns) in enumerate(json.loads(sys.argv[2])):
    made = eccodes.codes_grib_new_from_samples(SAMPLES.get(kind, "regular_ll_sfc_grib2"))
    keys = {}
    if kind not in SAMPLES:
        first, last = ((46.0, 49.0), (49.0, 46.0))[1 - north]
        start, end = ((14.0, 10.0), (10.0, 14.0))[1 - west]
        keys = {"gridType": kind, "shapeOfTheEarth": 0, "latitudeOfFirstGridPointInDegrees": first,
                "longitudeOfFirstGridPointInDegrees": start, "iScansNegatively": west, "jScansPositively": north,
                "jPointsAreConsecutive": columns, "alternativeRowScanning": turns}
        keys |= {"Nx": 5, "Ny": 4} if kind in ("lambert", "polar_stereographic") else {"Ni": 5, "Nj": 4}
        if kind == "regular_ll":
            keys |= {"iDirectionIncrementInDegrees": 1, "jDirectionIncrementInDegrees": 1}
        else:
            keys |= {"LaDInDegrees": 45, **dict.fromkeys(
                ("DiInMetres", "DjInMetres") if kind == "mercator" else ("DxInMetres", "DyInMetres"), 20000)}
        if kind in ("regular_ll", "mercator"):
            keys |= {"latitudeOfLastGridPointInDegrees": last, "longitudeOfLastGridPointInDegrees": end}
        if kind == "lambert":
            keys |= {"LoVInDegrees": 10, "Latin1InDegrees": 45, "Latin2InDegrees": 45}
        if kind == "polar_stereographic":
            keys["orientationOfTheGridInDegrees"] = 10
    for name, value in keys.items():
        eccodes.codes_set(made, name, value)
    if kind != "sh":
        count = eccodes.codes_get_size(made, "values") if kind in SAMPLES else 20
        eccodes.codes_set_values(made, np.arange(count) * 1.0)
    path = Path(sys.argv[1], f"{number}.grib2")
    with path.open("wb") as file:
        eccodes.codes_write(made, file)
    try:
        field = _LabelledFile(InputFile(path), Choice()).field()
        x, y = (np.broadcast_to(each, field.shape).ravel().tolist()
                for each in field.placement.with_nodes(field.shape).nodes())
        out.append([x, y, np.asarray(field.values).ravel().tolist()])
    except InputError as error:
        out.append(str(error))
print(json.dumps(out), flush=True)
os._exit(0)
"""


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Any]]:
    """Files, and what is read of them: in a process of its own, as the libraries of eccodes harm others."""
    pytest.importorskip("cfgrib")
    folder = tmp_path_factory.mktemp("rows")
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", OF_GRIB, str(folder), json.dumps(GRIDS)],
                          capture_output=True, text=True, env=dict(os.environ), check=False)
    assert done.stdout, done.stderr
    return folder, json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("number", range(len(GRIDS)), ids=["-".join(map(str, grid)) for grid in GRIDS])
def test_rows_of_grib(read: tuple[Path, list[Any]], number: int) -> None:
    """Each value lies where GDAL has it, or the file is refused with the reason."""
    (kind, west, north, *more), found = GRIDS[number], read[1][number]
    if kind in ("reduced_gg", "sh"):
        assert f"points of {kind}" in found and "cdo" in found
        return
    if not kind.endswith(("_ll", "_gg")) and (west or not north):
        assert "wrong coordinates" in found
        return
    if kind == "regular_gg":
        x, y, values = map(np.array, found)
        rows = math.isqrt(len(values) // 2)
        latitudes = np.degrees(np.arcsin(np.polynomial.legendre.leggauss(rows)[0]))[::-1]
        row, column = np.divmod(np.rint(values).astype(int), 2 * rows)
        assert np.abs(y - latitudes[row]).max() < 2e-3 and np.abs(x - column * 180 / rows).max() < 2e-3
        return
    # where points scan to the west, GDAL has the coordinates of the other direction
    number = GRIDS.index((kind, 0, north, *more))
    with rasterio.Env(GRIB_NORMALIZE_UNITS="NO"), rasterio.open(read[0] / f"{number}.grib2") as file:
        values, system = file.read(1), pyproj.CRS.from_wkt(file.crs.to_wkt())
        rows, columns = np.indices(values.shape)
        x, y = file.transform * (columns + 0.5, rows + 0.5)
    if system.is_projected:
        x, y = pyproj.Transformer.from_crs(system, system.geodetic_crs, always_xy=True).transform(x, y)
    x = 24 - x if west else x
    asked = {round(value): (lon, lat) for lon, lat, value in zip(x.flat, y.flat, values.flat, strict=True)}
    assert len(asked) == len(found[2]) == values.size
    for lon, lat, value in zip(*found, strict=True):
        off = np.subtract((lon, lat), asked[round(value)])
        assert abs((off[0] + 180) % 360 - 180) < 2e-3 and abs(off[1]) < 2e-3
