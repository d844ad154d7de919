"""Draw the figures of the specification from decoded files: ``python tools/spec_figures.py [FOLDER]``.

They are written to ``spec/figures``, or to a folder. Axis 0 runs downwards, axis 1 to the right, as in annex C.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import cache
from itertools import combinations, permutations, product
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Polygon, Rectangle
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

import isocodec
from isocodec.format.events import HeaderRead, LayerComplete
from isocodec.grid.lattice.slots import middle_of
from isocodec.grid.lattice.tables import Simplex, bisect
from isocodec.grid.tube.leaf_vertices import drawn
from isocodec.stream.grid_contents import GridContents

FOLDER = Path(__file__).resolve().parent.parent / "spec" / "figures"
EXAMPLE = FOLDER.parent / "example.md"
INK, LINE, BLUE, ORANGE, PALE, WARM = "#1d2733", "#9aa5b1", "#1668a8", "#c8510a", "#d7e6f3", "#fbe2cd"
STYLE = {
    "svg.hashsalt": "isocodec", "svg.fonttype": "none", "font.family": "sans-serif", "font.size": 9,
    "text.color": INK, "path.simplify": True,
}
EXPONENT = 4
"""Of the field's root cube: 17 x 17 samples."""


def field() -> NDArray[np.int64]:
    """A large island, and two small ones that coarse levels do not see."""
    x, y = np.mgrid[:17, :17]
    large = 5.3 - np.hypot(1.15 * (x - 5.6), 0.9 * (y - 6.2))
    small = [size - np.hypot(x - a, y - b) for size, a, b in ((1.4, 14.1, 6.2), (1.7, 10.2, 14.1))]
    return np.rint(100 * np.maximum.reduce([large, *small])).astype(np.int64)


BASE = 4
"""Level that its file begins with."""


def encoded() -> bytes:
    """The field in the baseline profile."""
    plan = [("base", BASE), ("refine", None), ("values", None)]
    return isocodec.encode(field(), 0.5, layers=plan, profile="baseline")


class Decoded:
    """The state after each layer: leaves (T, 3, 2) in their order, known vertices with their signs, and curves."""

    def __init__(self, data: bytes) -> None:
        self.leaves: list[NDArray[np.int64]] = []
        self.known: list[dict[tuple[int, int], int]] = []
        self.layers: list[LayerComplete] = []
        self.curves: list[NDArray[np.float64]] = []
        decoder = isocodec.Decoder()
        decoder.feed(data)
        for event in decoder:
            if isinstance(event, HeaderRead):
                self.header = event.offset
            if not isinstance(event, LayerComplete):
                continue
            assert isinstance(decoder.contents, GridContents)
            tube = decoder.contents.tubes[0]
            rows = tube.state.vertex[: tube.vertices, [0, 1, 3]].tolist()
            self.known.append({(x, y): sign for x, y, sign in rows})
            self.leaves.append(tube.state.vertex[drawn(tube.state)[0], :2].astype(np.int64))
            contour = decoder.contents.contour()
            self.curves.append(contour.points[contour.cells])
            self.layers.append(event)


@cache
def decoded_file() -> Decoded:
    """The field's file, decoded."""
    return Decoded(encoded())


# --- drawing --------------------------------------------------------------------------------------------------------


Panel = tuple[float, float, float, float]
"""Left, bottom, width and height, as parts of those of the figure."""


def canvas(width: float, height: float, panels: Sequence[Panel]) -> tuple[Figure, list[Axes]]:
    """A figure of a size in inches, and panels without axes."""
    figure = Figure((width, height), facecolor="white")
    axes = [figure.add_axes(panel) for panel in panels]
    for each in axes:
        each.set_axis_off()
    return figure, axes


def side_by_side(width: float, height: float, count: int, top: float = 0.88) -> tuple[Figure, list[Axes]]:
    """Square panels in a row."""
    return canvas(width, height, [((i + 0.04) / count, 0.02, 0.92 / count, top - 0.02) for i in range(count)])


def frame(ax: Axes, last: float, title: str = "", margin: float = 0.06) -> None:
    """Samples from 0 to ``last``, axis 0 downwards."""
    ax.set_aspect("equal")
    ax.set_xlim(-margin * last, (1 + margin) * last)
    ax.set_ylim((1 + margin) * last, -margin * last)
    ax.set_title(title, fontsize=9.5, color=INK, pad=4)


def cells(ax: Axes, simplices: Any, fill: str = "none", edge: str = LINE, width: float = 0.8, order: float = 1) -> None:
    """Triangles, as one path: they take fewer bytes so."""
    outlines = [np.array([*simplex, simplex[0]])[:, ::-1] for simplex in simplices]
    path = Outline.make_compound_path(*(Outline(outline, closed=True) for outline in outlines))
    ax.add_patch(PathPatch(path, facecolor=fill, edgecolor=edge, linewidth=width, joinstyle="round", zorder=order))


def signs(ax: Axes, known: dict[tuple[int, int], int], size: float = 22, colour: str = INK) -> None:
    """Vertices: full if above, else hollow."""
    for sign, fill in ((0, "white"), (1, colour)):
        points = np.array([p for p, s in known.items() if s == sign]).reshape(-1, 2)
        ax.scatter(points[:, 1], points[:, 0], s=size, facecolor=fill, edgecolor=colour, linewidth=1, zorder=5)


def curve(ax: Axes, pieces: Any, colour: str = ORANGE, width: float = 1.6) -> None:
    """Pieces of two points each, as one path."""
    points = np.insert(np.array(pieces, float), 2, np.nan, axis=1).reshape(-1, 2)
    ax.plot(points[:, 1], points[:, 0], color=colour, linewidth=width, solid_capstyle="round", zorder=3)


def label(ax: Axes, x: float, y: float, text: str, **style: Any) -> None:
    ax.text(y, x, text, **{"ha": "center", "va": "center", "zorder": 7, **style})


def arrow(ax: Axes, start: Any, end: Any, colour: str = BLUE, **style: Any) -> None:
    ax.annotate("", (end[1], end[0]), (start[1], start[0]), zorder=6, arrowprops={
        "arrowstyle": "-|>,head_length=0.3,head_width=0.15", "color": colour, "linewidth": 1, **style,
    })


# --- the mesh (clause 4) --------------------------------------------------------------------------------------------


def of_level(n: int, k: int, level: int) -> list[Simplex]:
    """All simplices of a level of the root cube."""
    found = []
    for order in permutations(range(n)):
        point = [0] * n
        path = [tuple(point)]
        for axis in order:
            point[axis] = 1 << k
            path.append(tuple(point))
        found.append(tuple(path))
    for each in range(level):
        found = [child for simplex in found for child in bisect(simplex, n - each % n)]
    return found


def levels() -> Figure:
    figure, axes = side_by_side(7.6, 1.75, 5)
    for level, ax in enumerate(axes):
        frame(ax, 4, f"level {level}", 0.09)
        simplices = of_level(2, 2, level)
        cells(ax, simplices)
        first = simplices[0]
        cells(ax, [first], PALE, BLUE, 1.2, 2)
        if level < 4:
            a, b = first[0], first[2 - level % 2]
            ax.plot([a[1], b[1]], [a[0], b[0]], color=ORANGE, linewidth=2.2, zorder=4)
            ax.plot((a[1] + b[1]) / 2, (a[0] + b[0]) / 2, "o", color=ORANGE, markersize=5, zorder=5)
    return figure


def diamond_of(n: int, level: int, k: int, middle: tuple[int, ...]) -> list[Simplex]:
    """Members of the diamond of a middle, ordered by the sums of their vertices."""
    tag = n - level % n
    doubled = tuple(2 * x for x in middle)
    found = [s for s in of_level(n, k, level) if tuple(np.add(s[0], s[tag])) == doubled]
    return sorted(found, key=lambda s: np.sum(s, axis=0).tolist())


def diamond() -> Figure:
    figure, axes = side_by_side(7.2, 2.5, 3)
    _plane_diamond(axes[0], 4, (6, 10))
    _plane_diamond(axes[1], 5, (8, 6))
    _space_diamond(axes[2])
    return figure


def _corners(members: list[Simplex], tag: int) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Ends and ring, each in lexicographic order."""
    ends = sorted((members[0][0], members[0][tag]))
    return ends, sorted({v for s in members for v in s} - set(ends))


def _plane_diamond(ax: Axes, level: int, middle: tuple[int, ...]) -> None:
    members = diamond_of(2, level, EXPONENT, middle)
    ends, ring = _corners(members, 2 - level % 2)
    cells(ax, of_level(2, EXPONENT, level))
    cells(ax, members, PALE, BLUE, 1.2, 2)
    ax.plot([p[1] for p in ends], [p[0] for p in ends], color=ORANGE, linewidth=2.2, zorder=3)
    for points, name, colour in ((ends, "end", ORANGE), (ring, "ring", BLUE)):
        for number, point in enumerate(points):
            ax.plot(point[1], point[0], "o", color=colour, markersize=5, zorder=5)
            out = np.subtract(point, middle) / 2
            label(ax, *(point + 0.55 * out * [1, 1.35]), f"{name} {number}", color=colour, fontsize=8.5, bbox=HALO)
    ax.plot(middle[1], middle[0], "s", color=INK, markersize=5, zorder=6)
    label(ax, middle[0] - 0.42, middle[1] + 0.1, "w", fontsize=9, style="italic")
    for number, member in enumerate(members):
        x, y = middle + 1.25 * (np.mean(member, axis=0) - middle)
        label(ax, x, y, f"member {number}", fontsize=7.5)
    ax.set_aspect("equal")
    ax.set_xlim(middle[1] - 3.4, middle[1] + 3.4)
    ax.set_ylim(middle[0] + 3.4, middle[0] - 3.4)
    ax.set_title(f"n = 2, phase {level % 2}", fontsize=9.5, color=INK, pad=4)


HALO = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"}


def _space_diamond(ax: Axes) -> None:
    """The cube around its diagonal: six members, one of them filled."""
    members = diamond_of(3, 0, 1, (1, 1, 1))
    ends, ring = _corners(members, 3)

    def seen(p: Any) -> NDArray[np.float64]:
        # axis 0 towards the reader, axis 1 to the right, axis 2 upwards
        return np.array([p[1] - 0.62 * p[0], p[2] - 0.42 * p[0]])

    def line(a: Any, b: Any, colour: str, width: float, order: int, style: str = "-") -> None:
        ax.plot(*np.transpose([seen(a), seen(b)]), style, color=colour, linewidth=width, zorder=order)

    for member in members:
        for a, b in combinations(member, 2):
            if {a, b} != set(ends):
                inside = np.count_nonzero(np.subtract(a, b)) > 1
                line(a, b, LINE, 0.8, 1, ":" if inside else "-")
    for face in combinations(members[-1], 3):
        corners = [seen(p) for p in face]
        ax.add_patch(Polygon(corners, facecolor=PALE, edgecolor=BLUE, linewidth=1, alpha=0.6, zorder=2))
    around = _around(ring)
    for i, a in enumerate(around):
        line(a, around[i - 1], BLUE, 1.6, 3)
    line(*ends, ORANGE, 2.2, 4)
    centre = seen((1, 1, 1))
    for points, name, colour in ((ends, "end", ORANGE), (ring, "ring", BLUE)):
        for number, point in enumerate(points):
            x, y = seen(point)
            ax.plot(x, y, "o", color=colour, markersize=5, zorder=5)
            out = seen(point) - centre
            # the ends lie inside the outline, so their names go to where there is room
            x, y = (x, y) + (np.sign(out) * [0.52, -0.02] if name == "end" else out / np.hypot(*out) * [0.58, 0.32])
            ax.text(x, y, f"{name} {number}", color=colour, fontsize=8.5, ha="center", va="center", zorder=7)
    ax.plot(*centre, "s", color=INK, markersize=5, zorder=6)
    ax.text(centre[0] + 0.16, centre[1] - 0.07, "w", fontsize=9, style="italic", zorder=7)
    ax.set_aspect("equal")
    ax.set_xlim(-2.05, 2.85)
    ax.set_ylim(-1.85, 3.05)
    ax.set_title("n = 3, phase 0", fontsize=9.5, color=INK, pad=4)


def _around(ring: list[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """The corners of a ring, each beside the next along an edge of the cube."""
    order = [ring[0]]
    while len(order) < len(ring):
        order.append(next(p for p in ring if p not in order and np.abs(np.subtract(p, order[-1])).sum() == 2))
    return order


# --- layers (clause 5) ----------------------------------------------------------------------------------------------


def visits(known: dict[tuple[int, int], int], level: int) -> list[tuple[Simplex, Simplex | None]]:
    """Mixed simplices in the order of 5.3.4, each with the one from which its gate was left."""
    order, across = of_level(2, EXPONENT, level), dict[frozenset[Any], list[Simplex]]()
    for simplex in order:
        for i in range(3):
            across.setdefault(frozenset(simplex[:i] + simplex[i + 1 :]), []).append(simplex)

    def mixed(points: Any) -> bool:
        return len({known.get(p) for p in points} & {0, 1}) == 2

    found: dict[Simplex, Simplex | None] = {}
    for first in filter(mixed, order):
        stack: list[tuple[Simplex, Simplex | None]] = [(first, None)]
        while stack:
            simplex, left = stack.pop()
            if simplex in found:
                continue
            found[simplex] = left
            for i in range(3):
                face = frozenset(simplex[:i] + simplex[i + 1 :])
                stack += [(other, simplex) for other in across[face] if mixed(face) and other not in found]
    return list(found.items())


def walk() -> Figure:
    decoded = decoded_file()
    visited = visits(decoded.known[0], BASE)
    assert {frozenset(s) for s, _ in visited} == {frozenset(map(tuple, leaf)) for leaf in decoded.leaves[0].tolist()}
    figure, (ax,) = canvas(4.3, 4.3, [(0.01, 0.01, 0.98, 0.98)])
    frame(ax, 16, margin=0.04)
    cells(ax, of_level(2, EXPONENT, BASE), width=0.6)
    cells(ax, [simplex for simplex, _ in visited], PALE, BLUE, 1, 2)
    cells(ax, [visited[0][0]], WARM, ORANGE, 1.2, 2.5)
    for number, (simplex, left) in enumerate(visited, 1):
        if left:
            arrow(ax, np.mean(left, axis=0), np.mean(simplex, axis=0), shrinkA=5, shrinkB=6)
        label(ax, *np.mean(simplex, axis=0), str(number), fontsize=8)
    signs(ax, decoded.known[0], 30)
    return figure


def refinement_round() -> Figure:
    decoded = decoded_file()
    before, after = decoded.leaves[1], decoded.leaves[2]
    old, new = decoded.known[1], decoded.known[2]
    figure, axes = side_by_side(7.6, 2.75, 3)
    level = decoded.layers[1].layer.level
    titles = (f"leaves of level {level}, active middles", "signs of the middles", f"leaves of level {level + 1}")
    middles = {_middle_of(leaf) for leaf in before}
    for ax, title in zip(axes, titles, strict=True):
        frame(ax, 16, title, 0.04)
        cells(ax, of_level(2, EXPONENT, level), width=0.4)
    for ax in axes[:2]:
        cells(ax, before, PALE, BLUE, 0.9, 2)
        signs(ax, {p: s for p, s in old.items() if any((p == leaf).all(axis=1).any() for leaf in before)}, 14)
    curve(axes[0], [_subdivision_edge(leaf) for leaf in before])
    x, y = np.array(sorted(middles)).T
    axes[0].scatter(y, x, s=13, marker="s", color=ORANGE, zorder=6)
    signs(axes[1], {p: new[p] for p in middles}, 18, ORANGE)
    cells(axes[2], after, PALE, BLUE, 0.9, 2)
    corners = {tuple(p) for p in after.reshape(-1, 2).tolist()}
    signs(axes[2], {p: s for p, s in new.items() if p in corners and p not in middles}, 12)
    signs(axes[2], {p: s for p, s in new.items() if p in corners and p in middles}, 12, ORANGE)
    return figure


def _subdivision_edge(leaf: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The longest side of a triangle is the one to be cut."""
    sides = [(leaf[i], leaf[j]) for i in range(3) for j in range(i)]
    return max(sides, key=lambda side: int(((side[0] - side[1]) ** 2).sum()))


def _middle_of(leaf: NDArray[np.int64]) -> tuple[int, int]:
    a, b = _subdivision_edge(leaf)
    return int(a[0] + b[0]) // 2, int(a[1] + b[1]) // 2


# --- new components (clause 5.5) ------------------------------------------------------------------------------------


class Tree:
    """The symbols of a round's tree: what 5.5.3 decodes, from which new components there are (phase 0 of the plane)."""

    def __init__(self, known: dict[tuple[int, int], int], born: set[tuple[int, int]], edge: int) -> None:
        self.known, self.born, self.edge = dict(known), born, edge
        self.most = (16 // edge).bit_length() - 1
        self.nodes: list[tuple[int, tuple[int, int], str]] = []  # height, index, and the symbol, (1) without one, or -
        self._node(self.most, (0, 0), str(int(bool(born))))

    def _middle(self, index: tuple[int, int]) -> tuple[int, int]:
        x, y, _ = middle_of(2, 0, *index, 0, 0)
        return int(x) * self.edge // 2, int(y) * self.edge // 2

    def _corners(self, index: tuple[int, int]) -> list[tuple[int, int]]:
        return [((index[0] + i) * self.edge, (index[1] + j) * self.edge) for i, j in product((0, 1), repeat=2)]

    def _candidate(self, index: tuple[int, int]) -> bool:
        around = {self.known[p] for p in self._corners(index) if p in self.known}
        return self._middle(index) not in self.known and len(around) < 2

    def _births(self, height: int, index: tuple[int, int]) -> bool:
        reach = self.edge << height
        return any(all(i * reach <= x < (i + 1) * reach for i, x in zip(index, p, strict=True)) for p in self.born)

    def _node(self, height: int, index: tuple[int, int], symbol: str) -> None:
        self.nodes.append((height, index, symbol))
        if symbol in "0-":
            return
        if height == 0:
            # the new component makes the corners of its diamond known
            sign = 1
            self.known[self._middle(index)] = sign
            self.known.update(dict.fromkeys(self._corners(index), 1 - sign))
            return
        hits = 0
        for i in range(4):
            child = 2 * index[0] + (i >> 1), 2 * index[1] + (i & 1)
            if height == 1 and not self._candidate(child):
                self._node(0, child, "-")
                continue
            here = self._births(height - 1, child)
            self._node(height - 1, child, "(1)" if i == 3 and hits == 0 else str(int(here)))
            hits += here


def tree() -> Figure:
    decoded = decoded_file()
    before, known = decoded.leaves[0], decoded.known[0]
    middles = {_middle_of(leaf) for leaf in before}
    born = {p for p, s in decoded.known[1].items() if p not in known and p not in middles and s == 1}
    found = Tree(known, born, 4)
    coded = [symbol for _, _, symbol in found.nodes if symbol in "01"]
    assert len(coded) == decoded.layers[1].symbols["significance"]
    figure, (left, right) = canvas(7.4, 3.0, [(0.01, 0.02, 0.37, 0.95), (0.39, 0.02, 0.6, 0.95)])
    frame(left, 16, margin=0.03)
    for i, j in product(range(4), repeat=2):
        left.add_patch(Rectangle((4 * j, 4 * i), 4, 4, facecolor="none", edgecolor=LINE, linewidth=0.7))
    for height, (i, j), symbol in found.nodes:
        size = 4 << height
        place = Rectangle((size * j, size * i), size, size, linewidth=0, zorder=0)
        if height == 0:
            place.set_facecolor({"1": WARM, "(1)": WARM, "0": PALE}.get(symbol, "none"))
            left.add_patch(place)
            label(left, size * i + 0.6, size * j + 0.7, symbol if symbol != "-" else "", fontsize=8)
        if height == 1:
            left.add_patch(Rectangle((size * j, size * i), size, size, facecolor="none", edgecolor=BLUE, linewidth=1.6,
                                     zorder=2))
            if symbol == "0":
                place.set_facecolor(PALE)
                left.add_patch(place)
                label(left, size * i + 0.75, size * j + 0.75, "0", fontsize=8)
    curve(left, decoded.curves[-1], INK, 1)
    left.scatter([p[1] for p in born], [p[0] for p in born], s=26, marker="s", color=ORANGE, zorder=6)
    _draw_tree(right, found)
    return figure


def _draw_tree(ax: Axes, found: Tree) -> None:
    ax.set_xlim(-0.8, 7.6)
    ax.set_ylim(-0.5, 2.5)
    places: dict[tuple[int, tuple[int, int]], float] = {}
    count = 0
    for height, index, symbol in found.nodes:
        if height == 0 or (height == 1 and symbol == "0"):
            places[height, index] = 0.78 * count
            count += 1
    for height in (1, 2):
        for h, index, _ in found.nodes:
            if h != height or (h, index) in places:
                continue
            below = [x for (g, child), x in places.items() if g == h - 1 and (child[0] >> 1, child[1] >> 1) == index]
            places[h, index] = float(np.mean(below))
    for height, index, symbol in found.nodes:
        x, y = places[height, index], float(height)
        if height < found.most:
            above = places[height + 1, (index[0] >> 1, index[1] >> 1)]
            style = ":" if symbol == "-" else "-"
            ax.plot([above, x], [y + 1, y], style, color=LINE, linewidth=1, zorder=1)
        fill = {"0": PALE, "-": "white"}.get(symbol, WARM)
        edge = {"0": BLUE, "-": LINE}.get(symbol, ORANGE)
        ax.text(x, y, symbol, ha="center", va="center", fontsize=9, zorder=3,
                bbox={"boxstyle": "round,pad=0.3", "facecolor": fill, "edgecolor": edge,
                      "linestyle": ":" if symbol in ("-", "(1)") else "-"})
    ax.text(7.6, -0.45, "(1) without a symbol; - no candidate", ha="right", va="center", fontsize=8)
    for height, text in ((2, "height 2: the root"), (1, "height 1"), (0, "height 0: cubes")):
        ax.text(-0.75, height + 0.3, text, ha="left", va="center", fontsize=8, color=INK)


# --- range coder (clause 6) -----------------------------------------------------------------------------------------


def interval() -> Figure:
    """The first symbols of annex C.2."""
    rows = []
    for line in EXAMPLE.read_text(encoding="utf-8").partition("| no. |")[2].splitlines()[2:7]:
        _, element, _, _, *numbers, bit, _ = (cell.strip() for cell in line.strip("|").split("|"))
        rows.append((element, *(int(x, 16) for x in numbers), int(bit)))
    figure, (ax,) = canvas(7.4, 2.6, [(0.01, 0.03, 0.98, 0.94)])
    ax.set_xlim(-0.35, 2 * len(rows) + 0.1)
    ax.set_ylim(-0.12, 1.16)
    for i, (element, width, code, bound, bit) in enumerate(rows):
        x = 2 * i
        share = bound / width
        # a 1 takes the numbers below the bound, a 0 the others
        for low, high, symbol in ((0, share, 1), (share, 1, 0)):
            chosen = symbol == bit
            ax.add_patch(Rectangle((x, low), 0.55, high - low, facecolor=WARM if chosen else PALE, edgecolor=INK,
                                   linewidth=0.9, zorder=2))
            ax.text(x + 0.275, (low + high) / 2, str(symbol), ha="center", va="center", zorder=4,
                    fontweight="bold" if chosen else "normal")
        ax.annotate("code", (x + 0.56, code / width), (x + 0.72, code / width), color=ORANGE, fontsize=8, va="center",
                    arrowprops={"arrowstyle": "-|>,head_length=0.35,head_width=0.2", "color": ORANGE, "linewidth": 1.2,
                                "shrinkA": 0, "shrinkB": 0}, bbox=HALO, zorder=6)
        at = "top" if share > 0.7 else "center"
        ax.text(x - 0.05, share, f"bound {bound:08x}", fontsize=7, ha="right", va=at, rotation=90)
        ax.text(x + 0.275, 1.03, f"range {width:x}", fontsize=7.5, ha="center")
        ax.text(x + 0.275, 1.11, f"{i + 1}: {element}", fontsize=8, ha="center")
        if i + 1 < len(rows):
            low, high = (0, share) if bit else (share, 1)
            for a, b in ((low, 0), (high, 1)):
                ax.plot([x + 0.55, x + 2], [a, b], color=LINE, linewidth=0.8, linestyle="--", zorder=1)
    return figure


# --- a file (clause 3) ----------------------------------------------------------------------------------------------


def file() -> Figure:
    data, decoded = encoded(), decoded_file()
    shown = (0, 2, 4, len(decoded.layers) - 1)
    panels = [(0.02 + 0.25 * i, 0.01, 0.21, 0.5) for i in range(len(shown))]
    figure, (bar, *pictures) = canvas(7.6, 3.4, [(0.01, 0.58, 0.98, 0.41), *panels])
    bar.set_xlim(-0.5, len(data) + 0.5)
    bar.set_ylim(0, 3)
    run = decoded.layers[0].offset - decoded.layers[0].bytes
    kinds = [str(event.layer.kind.value) for event in decoded.layers]
    starts = [run, *(event.offset for event in decoded.layers)]
    parts = [(0, decoded.header, "header", PALE), (decoded.header, run, "", "white")]
    parts += [(starts[i], starts[i + 1], str(i + 1), WARM) for i in range(len(kinds))]
    parts.append((starts[-1], len(data), "CRC", PALE))
    for start, end, text, colour in parts:
        bar.add_patch(Rectangle((start, 1.1), end - start, 0.8, facecolor=colour, edgecolor=INK, linewidth=0.7))
        bar.text((start + end) / 2, 1.49, text, fontsize=7, ha="center", va="center")
    groups = [(starts[kinds.index(kind)], starts[len(kinds) - kinds[::-1].index(kind)], name) for kind, name in (
        ("base", "base"), ("refine", "rounds"), ("values", "values"))]
    bar.text(run - 0.3, 2.32, "head, program", fontsize=8, ha="right", va="center")
    whole = decoded.header, len(data), "chunk of layers"
    spans = [(2.12, group) for group in [(decoded.header, run, ""), *groups]]
    for level, (start, end, name) in [*spans, (2.62, whole)]:
        bar.plot([start + 0.3, end - 0.3], [level, level], color=INK, linewidth=0.9)
        bar.text((start + end) / 2, level + 0.2, name, fontsize=8, ha="center", va="center")
    for i, (number, ax) in enumerate(zip(shown, pictures, strict=True)):
        event = decoded.layers[number]
        frame(ax, 16, f"{event.offset} bytes: {'layer 1' if number == 0 else f'layers 1 to {number + 1}'}", 0.04)
        ax.add_patch(Rectangle((0, 0), 16, 16, facecolor="none", edgecolor=LINE, linewidth=0.7))
        curve(ax, decoded.curves[number])
        # from the byte after the layer down to its picture
        middle = (panels[i][0] + panels[i][2] / 2 - 0.01) / 0.98 * (len(data) + 1) - 0.5
        bar.plot([event.offset, event.offset, middle, middle], [1.1, 0.75, 0.45, 0.1], color=ORANGE, linewidth=1)
    return figure


FIGURES = {
    "levels": levels, "diamond": diamond, "walk": walk, "round": refinement_round, "tree": tree, "interval": interval,
    "file": file,
}


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        for name, make in FIGURES.items():
            make().savefig(folder / f"{name}.svg", metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
