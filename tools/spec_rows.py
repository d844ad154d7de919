"""Print the table of rows of the main profile's networks (spec clause 7.10), as the codec lays them out.

    python tools/spec_rows.py            print the table
    python tools/spec_rows.py --check    exit with 1 if the specification says otherwise
"""

from __future__ import annotations

import sys
from pathlib import Path

from isocodec.grid.models import network_rows as rows
from isospec.tables import ROWS

SPEC = Path(__file__).resolve().parent.parent / "spec" / "grids.md"
BEGIN, END = "<!-- rows: tools/spec_rows.py -->\n", "<!-- end of rows -->\n"
AXES = (2, 3)


def parts(n: int) -> dict[tuple[str, str, str], tuple[int, int]]:
    """First row and number of rows of each network and of its parts, by network, clause and part."""
    found: dict[tuple[str, str, str], tuple[int, int]] = {}

    def network(number: str, clause: str, first: int, count: int, /, **sizes: int) -> None:
        found[number, clause, "all"] = first, count
        at = 0
        for name, size in sizes.items():
            found[number, clause, name.replace("_", " ")] = first + at, size
            at += size
        assert at == count, (number, at, count)

    around = 2 * rows.AROUND[n]
    for r in range(n):
        network(
            str(r), "7.12", rows.SIGN_ROW[n][r], rows.SIGN_ROWS[n][r], around=around, edge=9, rarity=13,
            calm=rows.MANNER_ROWS - 22, earlier=rows.EARLIER_ROWS, corners=2 * rows.CLASSES[n][r],
        )
    network(
        "3", "7.13", rows.TREE_ROW[n], rows.TREE_ROWS[n], height=27, child=24, nearness=6, vertices=12, births=12,
        rarity=13, cells=rows.CELL_ROWS * rows.CELLS[n],
    )
    slots, on = (13, 14), rows.OFFSET_ROW[n]
    tail = {"parts_left": 14, "width": 14, "place": 8, "near": 8}
    network("4", "7.14", on, rows.OFFSET_ROWS, candidates=52 * slots[0], **tail)
    slot = 9 if n == 2 else slots[1]
    network(
        "5", "7.14", on + rows.OFFSET_ROWS, rows.LEAF_ROWS[n], candidates=52 * slot, **tail, axes=n,
    )
    network(
        "6", "7.16", rows.MESH_ROW[n], rows.MESH_ROWS[n], what=12, level=24, history=8,
        around=4 * rows.MESH_AROUND * n,
    )
    network(
        "7", "7.17", rows.BASE_ROW[n], rows.BASE_ROWS[n], case=16, earlier=2, around=2 * rows.BEHIND[n] * n * (n + 1),
    )
    assert rows.BASE_ROW[n] + rows.BASE_ROWS[n] == ROWS[n]
    return found


def table() -> str:
    """The table in Markdown."""
    by_axes = {n: parts(n) for n in AXES}
    heads = ("network", "clause", "part", "first, n = 2", "rows", "first, n = 3", "rows")
    lines = [f"| {' | '.join(heads)} |", "| --- | --- | --- " + "| ---: " * 4 + "|"]
    for key in by_axes[3]:
        cells = [*key]
        for n in AXES:
            cells += [str(x) for x in by_axes[n].get(key, ("-", "-"))]
        lines.append("| " + " | ".join(cells) + " |")
    return "".join(f"{line}\n" for line in lines)


def stated(text: str) -> str:
    """What the specification says between its markers."""
    begin = text.index(BEGIN) + len(BEGIN)
    return text[begin : text.index(END, begin)].strip("\n") + "\n"


def main(arguments: list[str]) -> int:
    """Print or check; returns the exit code."""
    if arguments not in ([], ["--check"]):
        print(__doc__, file=sys.stderr)
        return 2
    if not arguments:
        print(table(), end="")
        return 0
    if stated(SPEC.read_text(encoding="utf-8")) == table():
        return 0
    print("spec/grids.md states other rows than the codec uses: python tools/spec_rows.py prints them", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
