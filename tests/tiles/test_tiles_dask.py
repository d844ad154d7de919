"""Arrays of Dask in tiles, by threads and by a cluster: the bytes of the field in memory, also in a store."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from brute import INTERPRETED
from libraries import Late
from tiled import encoded, hilly

pytestmark = pytest.mark.skipif(INTERPRETED, reason="slow in Python, and the same")
dask = Late("dask")
array = Late("dask.array")
distributed = Late("distributed")
fsspec = Late("fsspec")
xarray = Late("xarray")
FIELD = hilly((180, 150))


def test_threads_read_and_encode_at_a_time(tmp_path: Path) -> None:
    """Of a slow source: as many slices at a time as there are threads, all bytes as of the field in memory."""
    busy, most = [0], [0]

    def slow(block: np.ndarray) -> np.ndarray:
        with lock:
            busy[0] += 1
            most[0] = max(most[0], busy[0])
        time.sleep(0.01)
        with lock:
            busy[0] -= 1
        return block

    lock = threading.Lock()
    field = array.from_array(FIELD, chunks=32).map_blocks(slow, dtype=FIELD.dtype, meta=FIELD[:0, :0])
    with dask.config.set(scheduler="synchronous"):
        assert encoded(tmp_path, field, 30.5, threads=3) == encoded(tmp_path, FIELD, 30.5)
    assert most[0] == 3


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as found:
        yield found


@pytest.mark.heavy
def test_a_cluster_encodes_what_it_computes(client: Any, tmp_path: Path) -> None:
    """Without an engine, too; samples computed on the cluster stay there."""
    ran: list[str] = []

    class Watched(type(client)):  # type: ignore[misc]
        def compute(self, what: Any, **options: Any) -> Any:
            ran.append(what.key)
            return super().compute(what, **options)

    client.__class__ = Watched
    alone, field = encoded(tmp_path, FIELD, 30.5), array.from_array(FIELD, chunks=(50, 70))
    for options in ({}, {"engine": client}):
        ran.clear()
        isocodec.save("memory://maps/map.iso", field, 30.5, tile=32, **options)  # type: ignore[arg-type]
        assert fsspec.filesystem("memory").cat("/maps/map.iso") == alone
        assert len(ran) == 30 and all(key.startswith("encode_tile") for key in ran)
    ran.clear()
    with dask.config.set(scheduler="threads"):
        assert encoded(tmp_path, field, 30.5, threads=None) == alone and not ran
    assert encoded(tmp_path, FIELD, 30.5, engine=client) == alone
    lazy, there = (xarray.DataArray(each, dims=("y", "x"), name="height") for each in (field, FIELD))
    assert encoded(tmp_path, lazy, 30.5, engine=client) == encoded(tmp_path, there, 30.5, threads=1)
