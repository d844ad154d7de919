"""Plans: the layers that their entries come to, the distances that their meshes keep, and what is refused."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails
from files import fed
from home import ROOT
from isocodec.errors import OptionError
from isocodec.field.placement import Placement
from isocodec.field.samples import check_field
from isocodec.format.kinds import LayerKind
from isocodec.grid.layers.plan import Criteria
from isocodec.search.original import original
from isocodec.search.proof import hausdorff
from isospec.container import SIGNATURE
from libraries import Late
from planned import plan
from tables import looped

gaussian_filter = Late("scipy.ndimage.gaussian_filter")
shapely = Late("shapely")
find_contours = Late("skimage.measure.find_contours")

FULL = 12
"""Level of the full grid of HILLS: two axes, a root cube with an edge of 64 samples."""


@pytest.fixture
def hills(tmp_path: Path) -> Path:
    path = tmp_path / "hills.npy"
    np.save(path, HILLS)
    return path


def layers_of(data: bytes) -> list[tuple[str, int, int, int]]:
    return [(layer.kind, layer.level, layer.plane, layer.parts) for layer in isocodec.open(data).info.layers]


def test_the_program_has_the_operations_of_the_entries() -> None:
    data = isocodec.encode(HILLS, 60.5, layers=plan("base 1\nrefine 2\nvalues 2\nrefine 1\nvalues 3"))
    # more base 1, more refine 2, more values 2 (8 bits above, 6 below), more refine 1, values 3: clause 3.6.1
    above, below = 195 - 60, 60  # HILLS has values from 0 to 195 at its samples at most 200
    assert HILLS.max() <= 200 and above.bit_length() == 8 and below.bit_length() == 6
    assert bytes.fromhex("81 92 a2 86 91 23") in data[len(SIGNATURE) : 40]


def test_two_bits_in_between_two_levels() -> None:
    """Row C2-geometry: two bits, another level, the bits that are new vertices' due, and down to one bit left."""
    entries = plan("base 10\nvalues 2\nrefine 1\nvalues 0\nrefine\nvalues left=1")
    data = isocodec.encode(HILLS, 60.5, layers=entries)
    told = [(kind, level, plane) for kind, level, plane, _ in layers_of(data)]
    assert told == [
        ("base", 10, 0), ("values", 10, 7), ("values", 10, 6), ("refine", 11, 0), ("values", 11, 6), ("refine", 12, 0),
        *(("values", 12, plane) for plane in (5, 4, 3, 2, 1)),
    ]
    decoder = fed(data)
    state = decoder.grid.state()
    assert state is not None
    padded = np.pad(HILLS > 60, 1, mode="edge")
    crossed = np.zeros(HILLS.shape, bool)
    for neighbours in (padded[2:, 1:-1], padded[:-2, 1:-1], padded[1:-1, 2:], padded[1:-1, :-2]):
        crossed |= neighbours != (HILLS > 60)
    told = crossed[tuple(state.position.T)]
    assert told.sum() == crossed.sum() > 100 and set(state.missing[told]) == {1}
    number = HILLS[tuple(state.position.T)].astype(int)
    assert np.array_equal(state.number[told], np.where(state.above, number - 61, 60 - number)[told] >> 1)


def far_by_shapely(data: bytes, layers: int | None, field: np.ndarray, isovalue: float) -> float:
    """How far the curve after some layers and that of the field lie apart, at most, both ways."""
    own = isocodec.open(data).contour(isovalue, layers=layers)
    lines = [shapely.MultiLineString([*each.points[each.cells]])
             for each in (own, original(check_field(field, isovalue)))]
    return max(
        float(shapely.distance(shapely.points(shapely.get_coordinates(one.segmentize(0.05))), other).max())
        for one, other in (lines, lines[::-1])
    )


DISTANCES = [
    ("adaptive-base distortion=2", None), ("adaptive-base topology distortion=1", None),
    ("adaptive-base distortion=1.5\noffsets 3", None),
    ("adaptive-base distortion=1\noffsets 3 unit=1\noffsets 3", None),
    ("adaptive-base distortion=2\nvalues", 0.25), ("adaptive-base topology distortion=1\nvalues 4", None),
    ("base 4\nadapt distortion=2\noffsets 9\nadapt distortion=0.5\noffsets 9", None),
    ("base 3\nadapt distortion=3\nadapt distortion=0.8 topology\nvalues", None),
    ("base 4\nrefine 1\nadapt distortion=1\nvalues 3\nadapt distortion=0.5\nvalues", 0.5),
]
"""Plans, and the step of values, if the field is one of floats."""


@pytest.mark.cover(2)
@pytest.mark.parametrize(("text", "step"), DISTANCES)
@pytest.mark.parametrize("seed", [0, 1])
def test_distortion_keeps_its_distance(text: str, step: float | None, seed: int) -> None:
    """The curve lies within each distance once the geometry behind its line is decoded, as measured by shapely."""
    noise = gaussian_filter(np.random.default_rng(seed).normal(size=(47, 58)), 3)
    field = 100 * noise / noise.std()
    if step is None:
        field = np.rint(field).astype(np.int32)
    options = {} if step is None else {"precision": f"step={step}"}
    data = isocodec.encode(field, 20.5, layers=plan(text), **options)
    kinds = [layer.kind for layer in isocodec.open(data).info.layers]
    wanted = [float(word.partition("=")[2]) for word in text.split() if word.startswith("distortion=")]
    begins = [i for i, kind in enumerate(kinds) if kind in ("adaptive_base", "adapt")]
    assert len(begins) == len(wanted)
    for begin, distance in zip(begins, wanted, strict=True):
        end = begin
        while end + 1 < len(kinds) and kinds[end + 1] in ("values", "offsets"):
            end += 1
        assert 0 < far_by_shapely(data, end + 1, field, 20.5) <= distance + 1e-6


def test_distances_of_further_isovalues_are_kept() -> None:
    """With what they know from an earlier one; and on leaves of its mesh."""
    noise = gaussian_filter(np.random.default_rng(2).normal(size=(50, 44)), 3)
    field = np.rint(100 * noise / noise.std()).astype(np.int32)
    texts = {
        20.5: "base 3\nadapt distortion=1\nvalues 4", 40.5: "adaptive-base distortion=1\nvalues",
        -30.5: "leaf-base\nadapt distortion=0.7\nvalues",
    }
    plans = {isovalue: plan(text) for isovalue, text in texts.items()}
    data = isocodec.encode(field, list(texts), layers=plans)
    assert isocodec.open(data).info.leans[1:] != [None, None]
    for isovalue, distance in zip(texts, (1, 1, 0.7), strict=True):
        assert far_by_shapely(data, None, field, isovalue) <= distance + 1e-6


def test_distances_that_cannot_be_kept() -> None:
    """Signs alone place crossings in the middle of edges; a level may be too coarse."""
    for text in ("base 2\nadapt distortion=0.2", "adaptive-base level=4 distortion=1\nvalues"):
        with pytest.raises(OptionError, match="no mesh was proven to stay within a distortion of"):
            isocodec.encode(HILLS, 60.5, layers=plan(text))


def test_a_distance_that_no_mesh_but_the_full_grid_keeps() -> None:
    """A slab with edges: implied points are too far away on all others, so the mesh gets full along the surface."""
    z, y, x = np.mgrid[:30, :34, :38] - np.array([14.2, 16.7, 18.1])[:, None, None, None]
    field = np.maximum(np.maximum(abs(z) - 8.3, abs(y) - 7.2), abs(x + y / 3) - 9.4)
    data = isocodec.encode(field, 0.0, layers=plan("adaptive-base distortion=0.15\noffsets 5"))
    whole, found = original(check_field(field, 0.0)), isocodec.decode(data)
    assert max(hausdorff(whole.points, whole.cells, found.points, found.cells)) <= 0.15 + 1e-2


TERRAIN = np.load(ROOT / "demo/data/jacksboro_fault_dem.npz")["values"][100:200, 100:220]
BENDS = 0.3
NUMBERS = {"level": 6, "curvature": BENDS, "distortion": 1.5}
CRITERIA = [f"{one.name}={NUMBERS[one.name]}" if one.name in NUMBERS else one.name for one in fields(Criteria)]
LATER = [
    *(f"adapt {one}" for one in CRITERIA), "refine 3", "refine", "offsets 3", "values",
    "offsets 3\nadapt level=8", "adapt level=6\nadapt level=8\nrefine",
]
"""What may follow a line with criteria: every kind of layer but a base."""


def test_all_kinds_that_may_follow_are_there() -> None:
    bases = {"base", "adaptive_base", "leaf_base"}
    assert {entry[0] for text in LATER for entry in plan(text)} | bases == {*LayerKind}


@pytest.mark.cover(2)
@pytest.mark.parametrize("later", LATER)
@pytest.mark.parametrize("first", ["topology", "crossing", "topology curvature=0.5", "level=7 crossing"])
@pytest.mark.parametrize("begin", ["adaptive-base", "adaptive-base 4", "base 2\nadapt"])
def test_topology_and_crossings_hold_for_later_lines(begin: str, first: str, later: str) -> None:
    """From the line on that asks for them, each layer has as many curves as the field."""
    data = isocodec.encode(TERRAIN, 668.5, layers=plan(f"{begin} {first}\n{later}"))
    file = isocodec.open(data)
    kept = range(1 + begin.count("\n"), len(file.info.layers) + 1)
    right = len(find_contours(TERRAIN.astype(float), 668.5))
    assert right == 14 and {len(file.contour(layers=count).lines) for count in kept} == {right}


@pytest.mark.cover(1)
@pytest.mark.parametrize("first", CRITERIA)
@pytest.mark.parametrize("later", CRITERIA)
def test_criteria_of_the_line_before(first: str, later: str) -> None:
    """Those about any mesh might as well be given again; a distance is kept by the line that states it."""
    text = f"adaptive-base {first}\nadapt {later}"
    if (first, later) == ("distortion=1.5", "level=6"):
        with pytest.raises(OptionError, match="a larger distortion or a finer level"):
            isocodec.encode(TERRAIN, 668.5, layers=plan(text))
        return
    data = isocodec.encode(TERRAIN, 668.5, layers=plan(text))
    name = first.partition("=")[0]
    if name in ("topology", "crossing", "curvature") and name not in later:
        assert isocodec.encode(TERRAIN, 668.5, layers=plan(f"{text} {first}")) == data
    for count, line in enumerate((first, later), start=1):
        if "distortion" in line:
            assert far_by_shapely(data, count, TERRAIN, 668.5) <= NUMBERS["distortion"] + 1e-6


def test_a_level_leaves_what_other_criteria_need() -> None:
    bends = isocodec.encode(TERRAIN, 668.5, layers=plan(f"adaptive-base curvature={BENDS} level=6"))
    assert isocodec.open(bends).mesh().levels.max() > 6
    level = isocodec.encode(TERRAIN, 668.5, layers=plan("adaptive-base level=6"))
    assert isocodec.open(level).mesh().levels.max() == 6


def test_one_criterion_is_that_of_encode() -> None:
    for text, options in (
        ("crossing", {"layers": "crossing"}),
        ("curvature=0.2", {"layers": "curvature=0.2"}),
        ("level=6", {"layers": "level=6"}),
        ("curvature=0.2 topology", {"layers": "curvature=0.2", "keep_topology": True}),
    ):
        planned = isocodec.encode(HILLS, 60.5, layers=plan(f"adaptive-base {text}"))
        assert planned == isocodec.encode(HILLS, 60.5, precision="signs", **options)


def test_isovalues_have_plans_of_their_own() -> None:
    plans = {60.5: plan("base 4\nrefine 4\nvalues 3"), 80.5: plan("leaf-base\nrefine\nvalues")}
    file = isocodec.open(isocodec.encode(HILLS, [60.5, 80.5], layers=plans))
    kinds = [layer.kind for layer in file.info.layers if layer.isovalue == 1]
    assert file.info.leans == [None, 0] and kinds[0] == "leaf_base" and kinds[-1] == "values"
    assert np.array_equal(file.above(80.5), HILLS > 80)
    with pytest.raises(OptionError, match=r"the plan has no entry for the isovalue 70\.5"):
        isocodec.encode(HILLS, [60.5, 70.5], layers=plans)
    # a plan without isovalues is one for all
    data = isocodec.encode(HILLS, [60.5, 70.5], layers=plan("base"), order="independent")
    assert layers_of(data) == [("base", FULL, 0, 0)] * 2


@pytest.mark.parametrize(
    "text, said",
    [
        ("base 4\nrefine 9", "9 rounds of refinement from level 4, but the full grid is level 12"),
        ("base\nadapt topology", "adaptive refinement of the full grid"),
        ("base\nrefine", "0 rounds of refinement from level 12"),
        ("base 4\nvalues 2\noffsets 3", "offsets after values"),
        ("base 4\nadaptive-base topology", "a second base"),
        ("base 13", "the base is at level 13, but the full grid is level 12"),
        ("refine 2", "a layer before the base"),
        ("leaf-base", "a leaf base, but no earlier isovalue"),
        ("base\nvalues 40", "more bits of values are asked for than there are"),
        ("base\noffsets 64", "offsets cannot divide 1 parts into 64 each"),
        ("base 2\noffsets 3 unit=25", "unit"),
    ],
)
def test_an_entry_that_cannot_be_carried_out_is_named(text: str, said: str) -> None:
    with pytest.raises(OptionError, match="the plan cannot be carried out") as caught:
        isocodec.encode(HILLS, 60.5, layers=plan(text))
    assert said in str(caught.value) and caught.value.code == "plan"


def test_what_is_wrong_with_a_plan_as_a_whole() -> None:
    for layers, said in (
        ([], "the plan has no layers"), ("base 3", "unknown layers 'base 3'"), ([("bass", 2)], "unknown layer 'bass'"),
    ):
        with pytest.raises(OptionError, match=said):
            isocodec.encode(HILLS, 60.5, layers=layers)
    for more in ({"precision": "exact"}, {"precision": "signs"}, {"precision": 1}, {"keep_topology": True}):
        with pytest.raises(OptionError, match=r"a plan and .* cannot be combined"):
            isocodec.encode(HILLS, 60.5, layers=plan("base"), **more)
    with pytest.raises(OptionError, match="a plan with values of floats needs a step"):
        isocodec.encode(HILLS / 7, 9.5, layers=plan("base\nvalues"))
    assert isocodec.encode(HILLS / 7, 9.5, layers=plan("base\nvalues"), precision="step=0.1")


def test_a_label_with_a_plan() -> None:
    data = isocodec.encode(isocodec.Field(HILLS, labels=(3,)), layers=plan("base 3\nrefine"))
    assert np.array_equal(isocodec.open(data).above(), HILLS == 3)


JUST = float(np.nextafter(1.0, 9.0))


@looped(
    "steps",
    [(1, 1, 0.25), (1, JUST, 0.25), (2, 0.5, 0.5), (2, 0.5, 1), (1, 1), (2, 2, "exact"), (0.5, 1, "exact")], ids=str
)
@looped("how", ["list", "text", "world", "command"])
def test_steps_that_do_not_fall_are_refused(
    steps: tuple[float | str, ...], how: str, tmp_path: Path, hills: Path
) -> None:
    """Equal ones, rising ones, first or last, whoever gives them."""
    text = ",".join(map(str, steps))
    if how == "command":
        assert "must decrease" in fails(2, "encode", hills, "-o", tmp_path / "a.iso", "--isovalue", 80.5,
                                        "--precision", text)
        return
    field = isocodec.Field(HILLS, placement=Placement((1, 1), unit="m"))
    given = {"list": list(steps), "text": text, "world": ",".join(f"{step}m" if step != "exact" else "exact"
                                                                   for step in steps)}[how]
    with pytest.raises(OptionError) as caught:
        isocodec.encode(field, 80.5, precision=given)
    assert caught.value.code == "steps"


def test_steps_that_hardly_fall() -> None:
    data = isocodec.encode(HILLS, 80.5, precision=[JUST, 1, 0.25])
    assert isocodec.open(data).verify(HILLS)[0].kept


def test_steps_of_less_than_a_tenth_of_a_cell_are_refused() -> None:
    assert isocodec.open(isocodec.encode(HILLS, 80.5, precision=[1, 0.1])).info.layers
    with pytest.raises(OptionError, match=r"at least 0\.1 cells"):
        isocodec.encode(HILLS, 80.5, precision=[1, 0.05])
