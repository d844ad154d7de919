"""Measure a contour map in one step against GDAL: processor time and memory of whole processes, in the same run.

    python tools/bench_maps.py                            a terrain of 1201 x 1201 samples that is made up, 52 isovalues
    python tools/bench_maps.py terrain.npy --levels 100   another one

The command is ``isocodec encode dem.tif -o map.gpkg --interval ..``. Beside it stands ``gdal_contour``; where that is
not installed, the function of GDAL that it calls (``GDALContourGenerateEx``), from the library that pyogrio brings, in
a Python process that loads nothing else. For each, the best of several runs counts. The exit code is 1 if a bound is
exceeded.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import rasterio
from numpy.typing import NDArray

import isocodec

BOUNDS = {"processor time": 6.0, "memory": 3.0}
"""Ratios that must hold."""
SIDE, SEED, LOW, HIGH = 1201, 6, -12, 1923
GDAL = """
import ctypes, sys
from ctypes import c_char_p, c_int, c_void_p
gdal = ctypes.CDLL(sys.argv[1])
def call(name, result, *arguments):
    function = getattr(gdal, name)
    function.restype = result
    function.argtypes = [{bytes: c_char_p, int: c_int}.get(type(each), c_void_p) for each in arguments]
    found = function(*arguments)
    return c_void_p(found) if result is c_void_p else found
call("GDALAllRegister", None)
source = call("GDALOpen", c_void_p, sys.argv[2].encode(), 0)
band = call("GDALGetRasterBand", c_void_p, source, 1)
system = call("GDALGetSpatialRef", c_void_p, source)
driver = call("OGRGetDriverByName", c_void_p, b"GPKG")
target = call("OGR_Dr_CreateDataSource", c_void_p, driver, sys.argv[3].encode(), None)
layer = call("OGR_DS_CreateLayer", c_void_p, target, b"contour", system, 2, None)
for name, kind in ((b"ID", 0), (b"elev", 2)):
    call("OGR_L_CreateField", c_int, layer, call("OGR_Fld_Create", c_void_p, name, kind), 0)
words = [b"LEVEL_INTERVAL=" + sys.argv[4].encode(), b"LEVEL_BASE=0", b"ID_FIELD=0", b"ELEV_FIELD=1"]
options = (c_char_p * (len(words) + 1))(*words, None)
call("OGR_L_StartTransaction", c_int, layer)
failed = call("GDALContourGenerateEx", c_int, band, layer, ctypes.cast(options, c_void_p), None, None)
call("OGR_L_CommitTransaction", c_int, layer)
call("OGR_DS_Destroy", None, target)
sys.exit(failed)
"""
"""Draws contours as gdal_contour does: library, raster, map, interval."""
RUN = """
import os, sys
pid = os.spawnvp(os.P_NOWAIT, sys.argv[1], sys.argv[1:])
_, status, used = os.wait4(pid, 0)
print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)
sys.exit(os.waitstatus_to_exitcode(status))
"""
"""Runs a command, from a small process: the memory of a process counts what it was forked from."""


def made_up() -> NDArray[np.int16]:
    """Make a terrain whose roughness is that of mountains: noise with a spectrum that falls with the frequency."""
    frequency = np.hypot(np.fft.fftfreq(SIDE)[:, None], np.fft.rfftfreq(SIDE)[None])
    frequency[0, 0] = np.inf
    noise = np.fft.rfft2(np.random.default_rng(SEED).normal(size=(SIDE, SIDE)))
    heights = np.fft.irfft2(noise / frequency**1.8, (SIDE, SIDE))
    heights = (heights - heights.min()) / np.ptp(heights)
    return np.rint(LOW + heights * (HIGH - LOW)).astype(np.int16)


def interval_of(values: NDArray[Any], levels: int) -> int:
    """Find an interval with this many multiples within the range of the data."""
    low, high = int(values.min()), int(values.max())
    for interval in range(1, high - low):
        if len(range(-(-low // interval) * interval, high, interval)) == levels:
            return interval
    raise SystemExit(f"no interval has {levels} multiples from {low} to {high}")


def measured(words: list[str], target: Path, runs: int, **environment: str) -> tuple[float, float]:
    """Run a command several times; returns the least processor time, s, and the least of its largest memory, MB."""
    found = []
    for _ in range(runs):
        target.unlink(missing_ok=True)
        done = subprocess.run([sys.executable, "-c", RUN, *words], capture_output=True, text=True,
                              env={**os.environ, **environment})
        if done.returncode:
            raise SystemExit(f"{words[0]} {words[1]} .. ended with {done.returncode}: {done.stderr}")
        found.append([float(number) for number in done.stdout.split()[-2:]])
    seconds, memory = np.min(found, axis=0).tolist()
    return seconds, memory


def gdal(dem: Path, target: Path, interval: int) -> tuple[str, list[str]]:
    """Find the command that draws contours with GDAL."""
    if (program := shutil.which("gdal_contour")) is not None:
        return "gdal_contour", [program, "-q", "-f", "GPKG", "-a", "elev", "-i", str(interval), str(dem), str(target)]
    folder = Path(pyogrio.__file__).parent
    library = next((each for each in folder.with_name("pyogrio.libs").glob("libgdal*")), None)
    if library is None:
        raise SystemExit("neither gdal_contour nor a wheel of pyogrio with GDAL is installed")
    return f"GDAL {pyogrio.__gdal_version_string__}", [
        sys.executable, "-c", GDAL, str(library), str(dem), str(target), str(interval)
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("terrain", nargs="?", type=Path, help="an array of integers, .npy")
    parser.add_argument("--levels", type=int, default=52)
    parser.add_argument("--runs", type=int, default=3)
    given = parser.parse_args()
    values = made_up() if given.terrain is None else np.load(given.terrain)
    interval = interval_of(values, given.levels)
    data = Path(pyogrio.__file__).parent
    with tempfile.TemporaryDirectory() as folder:
        dem, ours, theirs = (Path(folder) / name for name in ("dem.tif", "ours.gpkg", "theirs.gpkg"))
        step = 1 / (SIDE - 1)
        with rasterio.open(
            dem, "w", driver="GTiff", height=values.shape[0], width=values.shape[1], count=1, dtype=values.dtype,
            crs="EPSG:4326", transform=rasterio.transform.from_origin(6 - step / 2, 44 + step / 2, step, step),
        ) as file:
            file.write(values, 1)
        name, words = gdal(dem, theirs, interval)
        paths = {"PROJ_DATA": str(data / "proj_data"), "GDAL_DATA": str(data / "gdal_data")}
        command = [sys.executable, "-m", "isocodec", "encode", str(dem), "-o", str(ours), "--interval", str(interval)]
        # byte code, which an installed package has, is kept in the folder
        code = {"PYTHONPYCACHEPREFIX": folder, "PYTHONDONTWRITEBYTECODE": ""}
        measured(command, ours, 1, **code)
        found = {
            "isocodec": measured(command, ours, given.runs, **code), name: measured(words, theirs, given.runs, **paths),
        }
        counts = [pyogrio.read_info(path)["features"] for path in (ours, theirs)]
    print(f"{values.shape[0]} x {values.shape[1]} samples, {given.levels} isovalues, every {interval}; "
          f"{counts[0]:,} lines, of GDAL {counts[1]:,}; isocodec {isocodec.__version__}\n")
    print(f"{'':20}{'processor time':>16}{'memory':>12}")
    for each, (seconds, memory) in found.items():
        print(f"{each:20}{seconds:14.2f} s{memory:9.0f} MB")
    ratios = [one / other for one, other in zip(found["isocodec"], found[name], strict=True)]
    print(f"{'ratio':20}{ratios[0]:16.2f}{ratios[1]:12.2f}")
    print(f"{'at most':20}{BOUNDS['processor time']:16.2f}{BOUNDS['memory']:12.2f}")
    return int(any(ratio > bound for ratio, bound in zip(ratios, BOUNDS.values(), strict=True)))


if __name__ == "__main__":
    sys.exit(main())
