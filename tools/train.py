"""Train the tables of the main profile anew: ``python tools/train.py FOLDER [-o spec/isospec/main.bin]``.

FOLDER is one of real arrays. The training data are the arrays listed in ``ITEMS`` and generated fields; none of them
is one that results are quoted on. Networks are trained (``networks.py``) on what the passes list around each symbol,
then the adaptive probabilities and mixing weights by coding all the data once more. Everything is done in a fixed order
and without functions that differ between machines, so the same bytes come out.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from decimal import ROUND_HALF_EVEN, Decimal, localcontext
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import networks
from acceptance import Item, items
from generated import blurred, generated
from isocodec.entropy.range_coder import FLOOR
from isocodec.field.samples import check_field
from isocodec.grid.lattice.tables import cube_exponent
from isocodec.grid.models import contexts as ctx
from isocodec.grid.models import network_rows as layout
from isocodec.grid.models import trained as models
from isocodec.search.promise import Promise
from isocodec.search.strategy import even_mesh, exponent_of, grid_plan, reduced
from isocodec.search.tolerance import grid_offsets
from isocodec.stream.encoder import encoder_of
from isospec.tables import HIDDEN, INPUTS, KINDS, MOST_LOGIT, NETS, ROWS, STARTS, Tables, packed, starts, unpacked
from networks import Listed, first_row, gathered

MAIN = Path("spec/isospec/main.bin")
KEPT = Path("build/training")
ITEMS = {
    2: (
        "grid/hsurf_eur11", "grid/uk_surface_altitude", "image/butterfly", "image/car_plate_de", "image/fruits",
        "image/moon", "image/retina_green_1411", "image/text", "medical/ct_head_pitch_20", "medical/ct_head_pitch_32",
        "medical/ct_small", "medical/mr_small", "medical/mr_vsseg_08", "terrain/etopo20",
    ),
    3: (
        "volume/fuel", "volume/head_mr_small", "volume/hydrogen", "volume/iron_protein", "volume/neghip",
        "volume/ukv_theta_hybrid",
    ),
}
MOST_SYMBOLS, MOST_LINES = 40_000, 1_500_000
"""Of one field: in the training of one network, and listed in all."""
FINE, COARSE = (0.05, 0.01, 0.0025), (1.0, 0.25, 2.0)
"""Tolerances to which crossings are told, by turns: on the full grid, and on meshes."""
SLACK = (0.25, 0.2, 0.4)
"""Tolerances for volumes, by turns, at which crossings of smooth surfaces may be off where that saves bytes."""
BENDS = (2.0, 0.4, 1.0)
"""Distances from the original curve to reduced ones, by turns, for adaptive refinement."""
LEVELS = (250, 1000, 4000)
"""Into how many steps the values of fields of floats are divided, by turns."""
SHARES = (8, 20, 32, 44, 56, 68, 80, 92)
"""Hundredths of a real array's samples that lie below its further isovalues."""
STEPS = (1, 5, 20)
"""How far a second isovalue lies above the first."""
SEARCHED = 90_000
"""Fields of fewer samples also come as files under a tolerance."""
TRUSTED = 24
"""Most symbols that a trained probability counts as."""
REMEMBERED, MOST_FILES = 1500, 25
"""Symbols of a context, and files with a kind of symbols, that trained probabilities and mixing weights reflect."""


def squash_table() -> NDArray[np.int64]:
    """The logistic function for all logits, rounded."""
    with localcontext() as context:
        context.prec = 40
        exact = (65536 / (1 + (Decimal(-x) / 256).exp()) for x in range(-MOST_LOGIT, MOST_LOGIT + 1))
        rounded = [int(p.to_integral_value(ROUND_HALF_EVEN)) for p in exact]
    return np.clip(np.array(rounded), FLOOR, 65536 - FLOOR)


# -- data ----------------------------------------------------------------------------------------------------------


def data(folder: Path, n: int, without: frozenset[str] = frozenset()) -> list[Item]:
    """All training data of a dimension, the items of the folder and generated fields by turns, but for some classes."""
    found = [item.half() for item in items(folder, n) if item.name in ITEMS[n]]
    missing = set(ITEMS[n]) - {item.name for item in found}
    if missing:
        raise SystemExit(f"{folder}: {', '.join(sorted(missing))} not found; the tables need all of them")
    if n == 2:
        # what a picture half as large shows is smoother or rougher
        found += [
            Item(item.name, blurred(item.values.astype(float))[::2, ::2], item.isovalue)
            for item in found if item.values.size > SEARCHED // 2
        ]
    made = list(generated(n))
    for i, item in enumerate(made):
        found.insert((3 * i + 1) % len(found), item)
    return [item for item in found if item.name.split("/")[0] not in without]


# -- what the networks see -------------------------------------------------------------------------------------------


def use(n: int, squash: NDArray[np.int64], tables: Tables) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Let encoders start with these tables; probabilities of a 1, and symbols seen, that they start with."""
    begun = models.models(n, squash, tables)
    models._begun = lambda _: begun  # type: ignore[attr-defined]
    return begun[0], begun[1]


def traced(item: Item, options: dict[str, object]) -> list[NDArray[np.int16]]:
    """What the passes list around the symbols of a file's last isovalue, by network: symbol, number of rows, rows."""
    encoder = encoder_of(item.values, item.isovalue, profile="main", **options)  # type: ignore[arg-type]
    tube = encoder.frame.strands[0].tube
    trace = np.zeros((MOST_LINES, 3 + layout.MOST_ROWS), np.int32)
    tube.coder = tube.coder._replace(blend=tube.coder.blend._replace(trace=trace))
    begun = 0
    for _ in encoder:
        # a further isovalue goes on with the same list
        if len(encoder.frame.strands) > 1 and not begun:
            begun = trace[0, 0]
    lines = trace[1 + begun : trace[0, 0] + 1]
    found = []
    for net in range(NETS):
        own = np.flatnonzero(lines[:, 1] == net)
        own = own[:: 1 + len(own) // MOST_SYMBOLS]
        most = lines[own, 2].max(initial=0)
        count, rows = apart(models.members(item.values.ndim), lines[own, 2], lines[own, 3 : 3 + most])
        found.append(np.column_stack([lines[own, 0], count, rows]).astype(np.int16))
    return found


def apart(
    members: NDArray[np.int16], count: NDArray[np.int32], rows: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.int16]]:
    """What lists of rows stand for: how many rows of the networks each, and these, in the order of the list."""
    found = members[rows].reshape(len(rows), rows.shape[1] * members.shape[1])
    there = (found >= 0) & (np.repeat(np.arange(rows.shape[1]), members.shape[1]) < count[:, None])
    first = np.argsort(~there, axis=1, kind="stable")
    total = there.sum(axis=1)
    return total, np.take_along_axis(np.where(there, found, 0), first, axis=1)[:, : total.max(initial=0)]


def files(found: list[Item]) -> Iterator[tuple[Item, dict[str, object]]]:
    """What is coded: all items on the full grid, their crossings to one tolerance or another; small ones on meshes."""
    for i, item in enumerate(found):
        n = item.values.ndim
        full = n * cube_exponent(item.values.shape)
        yield item, {"layers": grid_plan(n, full, None) + grid_offsets(FINE[i % len(FINE)], True)}
        yield item, {"layers": "distortion=0.7", "precision": 0.1}
        if full > n:
            promise = Promise(check_field(item.values, item.isovalue))
            (_, _, mesh), *_ = reduced(promise, "distortion", BENDS[i % len(BENDS)], False)
            yield item, {"layers": [("base", n), ("adapt", 1, mesh)]}
            wanted = COARSE[i % len(COARSE)]
            if n == 3 and exponent_of(wanted) and (even := even_mesh(promise, wanted, False)):
                yield item, {"layers": even[1]}
        if i % 2 == 0:
            yield item, {"precision": "signs", "layers": full}
        if item.values.dtype.kind in "iu":
            yield item, {"precision": "exact"}
        else:
            yield item, {"precision": f"step={float(np.ptp(item.values)) / LEVELS[i % len(LEVELS)]}"}
        if item.values.size < SEARCHED:
            yield item, {"precision": COARSE[i % len(COARSE)]}
        if n == 3:
            # smooth surfaces take crossings with slack, in odd numbers of parts, on the full grid and on meshes
            yield item, {"precision": SLACK[i % len(SLACK)]}


def elsewhere(found: list[Item]) -> Iterator[tuple[Item, dict[str, object]]]:
    """The signs of the real items at further isovalues."""
    arrays = {(item.name, item.values.shape): item for item in found if item.name in ITEMS[item.values.ndim]}
    for i, item in enumerate(arrays.values()):
        order = np.sort(item.values, axis=None)
        values = order[order.size * np.array(SHARES) // 100]
        if item.values.dtype.kind in "iu":
            values = np.floor(values) + 0.5
        full = item.values.ndim * cube_exponent(item.values.shape)
        for value in np.unique(values[values < order[-1]]):
            other = replace(item, isovalue=float(value))
            yield other, {"layers": grid_plan(item.values.ndim, full, None)}
            if i % 3 == 0:
                yield other, {"precision": "signs", "layers": full}


def pairs(found: list[Item]) -> Iterator[tuple[Item, dict[str, object]]]:
    """The items of whole numbers with a second isovalue."""
    for i, item in enumerate(found):
        if item.values.dtype.kind in "iu":
            options = (
                {"precision": "signs"}, {},
                {"layers": "distortion=0.25", "precision": 0.1} if item.values.size < SEARCHED else {},
            )[i // 3 % 3]
            yield replace(item, isovalue=[item.isovalue, item.isovalue + STEPS[i % len(STEPS)]]), options


# -- adaptive probabilities ----------------------------------------------------------------------------------------


def adapted(n: int, coded: list[tuple[Item, dict[str, object]]], squash: NDArray[np.int64], tables: Tables) -> Tables:
    """The same networks with the mixing weights and probabilities that files have at their ends, on the average.

    Each file begins with what there is so far. Files count alike, but for those that have few symbols of a kind.
    """
    told = starts(squash)
    middles = (told[1:] + told[:-1]) / 2
    prob = models.models(n, squash, tables)[0]
    mean, weight = prob.astype(float), np.zeros(len(prob))
    mix, mixed = tables.mix.astype(float), np.zeros(KINDS)
    for item, options in coded:
        prob, seen = use(n, squash, tables)
        encoder = encoder_of(item.values, item.isovalue, profile="main", **options)  # type: ignore[arg-type]
        for _ in encoder:
            pass
        cd = encoder.frame.strands[-1].tube.coder
        count = np.where((cd.prob != prob) | (cd.seen != seen), np.maximum(cd.seen - seen, 1), 0)
        # nothing of value bits is trained
        count[ctx.VALUE : ctx.OFFSET] = count[STARTS:] = 0
        weight = np.minimum(weight + count, REMEMBERED)
        mean += (cd.prob - mean) * count / np.maximum(weight, 1)
        ended = cd.blend.mix[:KINDS, :INPUTS]
        changed = (ended != tables.mix).any(axis=1)
        mixed = np.minimum(mixed + changed, MOST_FILES)
        mix += (ended - mix) * (changed / np.maximum(mixed, 1))[:, None]
        used = np.flatnonzero(weight)
        state = np.stack([used, told[np.searchsorted(middles, mean[used])], np.minimum(weight[used], TRUSTED)], 1)
        tables = Tables(tables.weight, tables.out, np.rint(mix).astype(np.int64), state.astype(np.int64))
    return tables


def kept(listed: Listed, n: int, net: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """A network (`networks.network`), from ``KEPT`` if a run that was stopped had finished it."""
    told = sha256(Path(networks.__file__).read_bytes())
    for part in listed:
        told.update(part.tobytes())
    path = KEPT / f"{n}-{net}-{told.hexdigest()[:16]}.npz"
    if not path.exists():
        weight, out = networks.network(listed, n, net)
        KEPT.mkdir(parents=True, exist_ok=True)
        np.savez(path, weight=weight, out=out)
    with np.load(path) as found:
        return found["weight"], found["out"]


def trained(folder: Path, n: int, squash: NDArray[np.int64], without: frozenset[str]) -> Tables:
    """Tables of one dimension."""
    mix = np.zeros((KINDS, INPUTS), np.int64)
    mix[:] = (52429, 13107, 13107, 0)
    weight = np.zeros((ROWS[n], HIDDEN), np.int16)
    out = np.zeros((NETS, HIDDEN + 1), np.int64)
    tables = Tables(weight, out, mix, np.zeros((0, 3), np.int64))
    found = data(folder, n, without)
    use(n, squash, tables)
    once, twice = list(files(found)), list(pairs(found))
    lines = [traced(item, options) for item, options in (*once, *twice, *elsewhere(found))]
    for net in range(NETS):
        first = first_row(n, net)
        found_weight, out[net] = kept(gathered([of_file[net] for of_file in lines], first), n, net)
        weight[first : first + len(found_weight)] = found_weight
    return adapted(n, [*twice, *once], squash, tables)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=MAIN)
    parser.add_argument("--only", type=int, choices=tuple(ROWS), help="train tables of so many axes, keep the others")
    parser.add_argument("--without", default="", metavar="CLASS,..",
                        help="leave classes out, as image, medical, writing, to see what is lost on them")
    options = parser.parse_args()
    squash = squash_table()
    asked = [options.only] if options.only else list(ROWS)
    found = {} if len(asked) == len(ROWS) else unpacked(MAIN.read_bytes())[1]
    without = frozenset(options.without.split(","))
    with ProcessPoolExecutor(len(asked)) as pool:
        jobs = {n: pool.submit(trained, options.folder, n, squash, without) for n in asked}
        found |= {n: job.result() for n, job in jobs.items()}
    options.output.write_bytes(packed(squash, found))
    print(f"{options.output}: {options.output.stat().st_size} bytes")


if __name__ == "__main__":
    main()
