"""Encode all tiles, in threads, processes or a Dask cluster; the bytes are the same."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from queue import SimpleQueue
from typing import Any, Protocol

import numpy as np

from ..errors import InputError
from ..verbs import Progress, threads_of
from .layout import Index, in_order
from .spool import Spool
from .tile_encoder import TileSegments, Tiling, encode_tile

AHEAD = 2
"""Number of tiles in progress for each worker, and of additional ones."""
HANDED_OVER = 1 << 16
"""Largest size of a field, in bytes, that is sent along with each tile."""


class Engine(Protocol):
    """Runs functions: an executor of ``concurrent.futures``, or a client of ``dask.distributed``."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **options: Any) -> Any:
        """Submit a function to be called elsewhere."""


def run(
    field: Any, tiling: Tiling, spool: Spool, engine: Engine | None = None, threads: int | None = None,
    progress: Progress | None = None,
) -> None:
    """Encode the tiles that a spool lacks.

    The field is anything with ``shape``, ``dtype`` and slices: an array of numpy, Dask, xarray, Zarr or h5py, or the
    windows of a file. Other processes read slices themselves if the object can be sent in few bytes (Zarr, windows of a
    file, Dask on a cluster); otherwise slices are read here. Threads read slices of Dask themselves. Without an engine,
    the cluster that Dask computes an array on encodes, and otherwise threads.

    Raises `InputError` as `encode_tile` does, naming the tile, or if workers died; finished tiles are kept.
    """
    total = tiling.grid.total
    waiting = (index for index in map(tuple, in_order(tiling.grid.counts).tolist()) if not spool.done(index))
    if engine is threads is None and hasattr(field, "__dask_graph__"):
        engine = _cluster_of(field)
    count = threads_of(threads) if engine is None else _workers_of(engine)
    with ExitStack() as own:
        if engine is None and count > 1:
            engine = own.enter_context(ThreadPoolExecutor(count))
        tiles = _encoded(field, tiling, waiting, engine, count)
        for done, tile in enumerate(tiles, start=total - spool.tiles.missing()):
            spool.add(tile)
            if progress:
                progress(done + 1, total)


def _workers_of(engine: Any) -> int:
    """Number of an engine's workers, if it states this."""
    if hasattr(engine, "nthreads"):
        return max(sum(engine.nthreads().values()), 1)
    return int(getattr(engine, "_max_workers", 1))


def _encoded(
    field: Any, tiling: Tiling, waiting: Iterator[Index], engine: Engine | None, workers: int
) -> Iterator[TileSegments]:
    if engine is None:
        for index in waiting:
            with _about(index):
                tile = encode_tile(_samples(field, tiling, index), index, tiling)
            yield tile
        return
    processes = isinstance(engine, ProcessPoolExecutor) or _is_cluster(engine)
    threads = isinstance(engine, ThreadPoolExecutor) and hasattr(field, "__dask_graph__")
    read_there = threads or (processes and _is_small(field))
    came: SimpleQueue[tuple[Index, Any]] = SimpleQueue()
    flying: dict[Index, Any] = {}
    failure: Exception | None = None
    try:
        while True:
            while failure is None and len(flying) < AHEAD * (workers + 1) and (index := next(waiting, ())):
                try:
                    with _about(index):
                        flying[index] = future = _submitted(engine, field, tiling, index, read_there)
                except Exception as error:
                    # tiles that have been read are encoded and kept first
                    failure = error
                else:
                    future.add_done_callback(lambda f, index=index: came.put((index, f)))
            if not flying:
                if failure is not None:
                    raise failure
                return
            index, future = came.get()
            del flying[index]
            with _about(index):
                tile = future.result()
            yield tile
    finally:
        for future in flying.values():
            future.cancel()


def _submitted(engine: Engine, field: Any, tiling: Tiling, index: Index, read_there: bool) -> Any:
    """Submit a tile to be encoded."""
    options: dict[str, Any] = {"pure": False} if _is_cluster(engine) else {}
    if _is_cluster(engine) and hasattr(field, "__dask_graph__"):
        from dask import delayed

        window = field[tiling.grid.window(index)]
        return engine.compute(delayed(encode_tile, **options)(window, index, tiling))  # type: ignore[attr-defined]
    if read_there:
        return engine.submit(_read_and_encoded, field, tiling, index, **options)
    return engine.submit(encode_tile, _samples(field, tiling, index), index, tiling, **options)


def _read_and_encoded(field: Any, tiling: Tiling, index: Index) -> TileSegments:
    return encode_tile(_samples(field, tiling, index), index, tiling)


def _is_cluster(engine: Engine) -> bool:
    """Whether this is a client of ``dask.distributed``, which need not be installed."""
    return hasattr(engine, "scheduler_info")


def _cluster_of(field: Any) -> Engine | None:
    """The client of ``dask.distributed`` that would compute an array of Dask, if any."""
    from dask.base import get_scheduler

    client = getattr(get_scheduler(collections=[field]), "__self__", None)
    return client if client is not None and _is_cluster(client) else None


def _is_small(field: Any) -> bool:
    """Whether a field can be sent in few bytes, because its samples are stored elsewhere."""
    if isinstance(field, np.ndarray):
        return False
    try:
        pickle.Pickler(_Few(), protocol=5).dump(field)
    except Exception:
        # too large to send, or not picklable, for which libraries raise errors of all kinds
        return False
    return True


class _Few:
    """A file that takes few bytes."""

    def __init__(self) -> None:
        self.left = HANDED_OVER

    def write(self, data: bytes | bytearray | memoryview) -> int:
        size = memoryview(data).nbytes
        self.left -= size
        if self.left < 0:
            raise OverflowError
        return size


def _samples(field: Any, tiling: Tiling, index: Index) -> Any:
    window = field[tiling.grid.window(index)]
    return window if isinstance(window, np.ma.MaskedArray) else np.asarray(window)


@contextmanager
def _about(index: Index) -> Iterator[None]:
    """Add the tile to error messages, and a remedy if a worker died."""
    try:
        yield
    except InputError as error:
        raise InputError(f"tile {index}: {error.message}", code=error.code, remedy=error.remedy) from None
    except (BrokenProcessPool, CancelledError) as error:
        raise _died(index) from error
    except Exception as error:
        # an error of a library that may be missing: a worker or the scheduler has died
        if type(error).__name__ in ("KilledWorker", "CommClosedError"):
            raise _died(index) from error
        raise


def _died(index: Index) -> InputError:
    return InputError(
        f"the worker that encoded tile {index} died", code="worker",
        remedy="run the same command again: complete tiles are kept",
    )
