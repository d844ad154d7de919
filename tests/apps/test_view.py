"""A terrain in tiles by URL in QGIS: when the first lines are on the map, and how many bytes that takes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from programs import command, installed, run
from served import served

import isocodec
from brute import HEAVY

pytestmark = pytest.mark.apps

SIDE, TILE = (12_000, 1024) if HEAVY else (2_000, 512)


def terrain(side: int) -> np.ndarray:
    """Heights in m, int16, at steps of 30 m: noise whose amplitude falls with frequency as that of mountains does."""
    import scipy.fft as fft

    some = np.random.default_rng(3)
    waves = np.hypot(fft.fftfreq(side)[:, None].astype(np.float32), fft.rfftfreq(side).astype(np.float32))
    amplitude = np.maximum(waves, np.float32(3 / 12_000)) ** np.float32(-1.8)
    amplitude[0, 0] = 0
    phase = np.exp(2j * np.pi * some.random(waves.shape, np.float32)).astype(np.complex64)
    heights = fft.irfft2(amplitude * phase * some.standard_normal(waves.shape, np.float32), s=(side, side))
    return np.asarray(np.maximum(1200 + 700 * heights / heights.std(), 0).round().astype(np.int16))


def test_first_lines_of_an_overview(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heights = terrain(SIDE)
    field = isocodec.Field(heights, placement=[[0, 30, 200_000], [-30, 0, 5_000_000]], crs="EPSG:32632")
    isocodec.save(tmp_path / "terrain.iso", field, np.arange(50.0, heights.max(), 50).tolist(), tile=TILE)
    plugins, bundle = installed(tmp_path)
    with served(tmp_path) as server:
        asked = {"path": f"/vsicurl/{server.url}/terrain.iso", "plugins": str(plugins),
                 "pictures": str(tmp_path / "map")}
        seconds = json.loads(run([*command("qgis", "in_qgis_view.py"), json.dumps(asked)], bundle).splitlines()[-1])
    size = (tmp_path / "terrain.iso").stat().st_size
    with capsys.disabled():
        print(f"\n{SIDE} x {SIDE} samples, {size:,} bytes: {server.sent:,} bytes read")
        for name, (clock, processor) in seconds.items():
            print(f"{name} lines after {clock:.1f} s, {processor:.1f} s of the processor")
    assert server.sent < min(size / 2, 2_000_000) and seconds["first"][0] < seconds["all"][0] / 2
