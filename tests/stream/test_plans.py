"""Plans as text: what each line comes to, what is refused and how, and that fields come back."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

import isocodec
from commands import HILLS, fails, ok
from files import fed
from home import ROOT
from isocodec.errors import OptionError
from isocodec.field.placement import Placement
from isocodec.field.samples import check_field
from isocodec.grid.layers.plan import Criteria
from isocodec.search.original import original
from isocodec.search.proof import hausdorff
from isocodec.stream.plan_file import _LINES, check_plan, read_plan
from isospec.container import SIGNATURE
from libraries import Late
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


def test_every_line_becomes_an_entry() -> None:
    text = """
    # a comment
    base 4        # and another
    base
    refine 3
    refine
    values 2
    values left=3
    values left=0
    values
    offsets 9
    offsets 9 unit=2
    leaf-base
    adaptive-base topology distortion=0.5
    adaptive-base 3 crossing
    adapt curvature=0.25
    adapt level=7 same-components
    """
    assert read_plan(text) == [
        ("base", 4), ("base", None), ("refine", 3), ("refine", None), ("values", 2), ("values", None, 3),
        ("values", None), ("values", None), ("offsets", 9, 0), ("offsets", 9, 2), ("leaf_base",),
        ("adaptive_base", 0, Criteria(topology=True, distortion=0.5)), ("adaptive_base", 3, Criteria(crossing=True)),
        ("adapt", 1, Criteria(curvature=0.25)), ("adapt", 0, Criteria(level=7)),
    ]


def test_the_program_has_the_operations_of_the_lines() -> None:
    data = isocodec.encode(HILLS, 60.5, layers="base 1\nrefine 2\nvalues 2\nrefine 1\nvalues 3")
    # more base 1, more refine 2, more values 2 (8 bits above, 6 below), more refine 1, values 3: clause 3.6.1
    above, below = 195 - 60, 60  # HILLS has values from 0 to 195 at its samples at most 200
    assert HILLS.max() <= 200 and above.bit_length() == 8 and below.bit_length() == 6
    assert bytes.fromhex("81 92 a2 86 91 23") in data[len(SIGNATURE) : 40]


def test_two_bits_in_between_two_levels() -> None:
    """Row C2-geometry: two bits, another level, the bits that are new vertices' due, and down to one bit left."""
    data = isocodec.encode(HILLS, 60.5, layers="base 10\nvalues 2\nrefine 1\nvalues 0\nrefine\nvalues left=1")
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
    data = isocodec.encode(field, 20.5, layers=text, **options)
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
    plans = "\n".join(f"isovalue {isovalue}\n{text}" for isovalue, text in texts.items())
    data = isocodec.encode(field, layers=plans)
    assert isocodec.open(data).info.leans[1:] != [None, None]
    for isovalue, distance in zip(texts, (1, 1, 0.7), strict=True):
        assert far_by_shapely(data, None, field, isovalue) <= distance + 1e-6


def test_distances_that_cannot_be_kept() -> None:
    """Signs alone place crossings in the middle of edges; a level may be too coarse."""
    for text, line in (("base 2\nadapt distortion=0.2", 2), ("adaptive-base level=4 distortion=1\nvalues", 1)):
        with pytest.raises(OptionError, match=rf"^line {line}, .*distortion of"):
            isocodec.encode(HILLS, 60.5, layers=text)


def test_a_distance_that_no_mesh_but_the_full_grid_keeps() -> None:
    """A slab with edges: implied points are too far away on all others, so the mesh gets full along the surface."""
    z, y, x = np.mgrid[:30, :34, :38] - np.array([14.2, 16.7, 18.1])[:, None, None, None]
    field = np.maximum(np.maximum(abs(z) - 8.3, abs(y) - 7.2), abs(x + y / 3) - 9.4)
    data = isocodec.encode(field, 0.0, layers="adaptive-base distortion=0.15\noffsets 5")
    whole, found = original(check_field(field, 0.0)), isocodec.decode(data)
    assert max(hausdorff(whole.points, whole.cells, found.points, found.cells)) <= 0.15 + 1e-2


TERRAIN = np.load(ROOT / "demo/data/jacksboro_fault_dem.npz")["values"][100:200, 100:220]
BENDS = 0.3
NUMBERS = {"level": 6, "curvature": BENDS, "distortion": 1.5}
CRITERIA = [f"{one.name}={NUMBERS[one.name]}" if one.name in NUMBERS else one.name for one in fields(Criteria)]
LATER = [
    *(f"adapt {one}" for one in CRITERIA), "refine 3", "refine", "raster", "offsets 3", "values",
    "offsets 3\nadapt level=8", "adapt level=6\nadapt level=8\nrefine",
]
"""What may follow a line with criteria: every kind of layer but a base."""


def test_all_lines_that_may_follow_are_there() -> None:
    bases = {"base", "adaptive-base", "leaf-base"}
    assert {line.split()[0] for text in LATER for line in text.splitlines()} | bases == set(_LINES)


@pytest.mark.cover(2)
@pytest.mark.parametrize("later", LATER)
@pytest.mark.parametrize("first", ["topology", "crossing", "topology curvature=0.5", "level=7 crossing"])
@pytest.mark.parametrize("begin", ["adaptive-base", "adaptive-base 4", "base 2\nadapt"])
def test_topology_and_crossings_hold_for_later_lines(begin: str, first: str, later: str) -> None:
    """From the line on that asks for them, each layer has as many curves as the field."""
    data = isocodec.encode(TERRAIN, 668.5, layers=f"{begin} {first}\n{later}")
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
            isocodec.encode(TERRAIN, 668.5, layers=text)
        return
    data = isocodec.encode(TERRAIN, 668.5, layers=text)
    name = first.partition("=")[0]
    if name in ("topology", "crossing", "curvature") and name not in later:
        assert isocodec.encode(TERRAIN, 668.5, layers=f"{text} {first}") == data
    for count, line in enumerate((first, later), start=1):
        if "distortion" in line:
            assert far_by_shapely(data, count, TERRAIN, 668.5) <= NUMBERS["distortion"] + 1e-6


def test_a_level_leaves_what_other_criteria_need() -> None:
    bends = isocodec.encode(TERRAIN, 668.5, layers=f"adaptive-base curvature={BENDS} level=6")
    assert isocodec.open(bends).mesh().levels.max() > 6
    assert isocodec.open(isocodec.encode(TERRAIN, 668.5, layers="adaptive-base level=6")).mesh().levels.max() == 6


def test_one_criterion_is_that_of_encode() -> None:
    for text, options in (
        ("crossing", {"layers": "crossing"}),
        ("curvature=0.2", {"layers": "curvature=0.2"}),
        ("level=6", {"layers": "level=6"}),
        ("curvature=0.2 topology", {"layers": "curvature=0.2", "keep_topology": True}),
    ):
        plan = read_plan(f"adaptive-base {text}")
        assert isocodec.encode(HILLS, 60.5, layers=plan) == isocodec.encode(HILLS, 60.5, precision="signs", **options)


def test_isovalues_have_plans_of_their_own(tmp_path: Path, hills: Path) -> None:
    plan, out = tmp_path / "two.plan", tmp_path / "two.iso"
    plan.write_text("isovalue 60.5\nbase 4\nrefine 4\nvalues 3\nisovalue 80.5\nleaf-base\nrefine\nvalues\n")
    assert json.loads(ok("encode", hills, "-o", out, "--layers", plan, "--json"))["isovalues"] == [60.5, 80.5]
    info = isocodec.open(out.read_bytes()).info
    kinds = [layer.kind for layer in info.layers if layer.isovalue == 1]
    assert info.leans == [None, 0] and kinds[0] == "leaf_base" and kinds[-1] == "values"
    assert np.array_equal(isocodec.open(out.read_bytes()).above(80.5), HILLS > 80)
    line = fails(2, "encode", hills, "-o", out, "--layers", plan, "--isovalue", 60.5)
    assert "the isovalues given, 60.5, differ from those of the plan, 60.5, 80.5" in line
    # without a line of an isovalue the plan is one for all
    plan.write_text("base\n")
    ok("encode", hills, "-o", out, "--layers", plan, "--isovalue", 60.5, "--isovalue", 70.5, "--order", "independent")
    assert layers_of(out.read_bytes()) == [("base", FULL, 0, 0)] * 2


@pytest.mark.parametrize(
    "text, line, said",
    [
        ("base 4\nrefine 9", 2, "9 rounds of refinement from level 4, but the full grid is level 12: give at most 8"),
        ("base\nadapt topology", 2, "adaptive refinement of the full grid: leave it out"),
        ("base\nrefine", 2, "leave it out: the mesh is already the full grid"),
        ("base 4\n\nvalues 2\noffsets 3", 4, "offsets after values: put offsets before the first values"),
        ("base 4\nadaptive-base topology", 2, "a second base"),
        ("base 13", 1, "the base is at level 13, but the full grid is level 12: give a level from 0 to 12"),
        ("values 2", 1, "a layer before the base: begin with base"),
        ("leaf-base", 1, "leaf-base needs an isovalue that is predicted from an earlier one"),
        ("base\nvalues 40", 2, "more bits of values are asked for than there are: fewer bits"),
        ("base\noffsets 4", 2, "the radix 4 must be odd: for example 5"),
        ("base 2\noffsets 3 unit=25", 2, "the unit at most 24"),
        ("base 4 5", 1, "base takes a level only"),
        ("base -1", 1, "it must be an integer, 0 or greater"),
        ("adaptive-base", 1, "the mesh needs a criterion: give crossing, topology"),
        ("adaptive-base distortion=nan", 1, "'nan' is not a distortion"),
        ("adaptive-base topology topology", 1, "topology is given twice"),
        ("# two\nbass 2", 2, "unknown layer 'bass': a line must begin with one of isovalue, base, "),
        ("isovalue 60.5\nbase\nisovalue 60.5\nbase", 3, "given twice"),
        ("isovalue 60.5\nisovalue 61.5\nbase", 2, "the isovalue before has no layers"),
        ("isovalue inf\nbase", 1, "an isovalue must be a finite number"),
    ],
)
def test_a_line_that_cannot_be_carried_out_is_named(
    tmp_path: Path, hills: Path, text: str, line: int, said: str
) -> None:
    plan, out = tmp_path / "wrong.plan", tmp_path / "out.iso"
    plan.write_text(text)
    message = fails(2, "encode", hills, "-o", out, "--layers", plan, *([] if "iso" in text else ["--isovalue", "60.5"]))
    assert f"wrong.plan: line {line}, {text.splitlines()[line - 1]!r}: " in message
    assert said in message
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hills.npy", "wrong.plan"]


def test_what_is_wrong_with_a_plan_as_a_whole(tmp_path: Path, hills: Path) -> None:
    plan, out = tmp_path / "some.plan", tmp_path / "out.iso"
    command = ["encode", hills, "-o", out, "--layers", plan]
    assert "some.plan: No such file" in fails(3, *command, "--isovalue", 60.5)
    plan.write_text("# nothing\n")
    assert "the plan has no layers" in fails(2, *command, "--isovalue", 60.5)
    plan.write_bytes(b"\xff\xfe")
    assert "not a plan, which is a short text" in fails(2, *command, "--isovalue", 60.5)
    plan.write_text("base")
    assert "the plan names no isovalue" in fails(2, *command)
    for more in (["--precision", "exact"], ["--precision", "signs"], ["--precision", 1], ["--keep-topology"]):
        line = fails(2, *command, "--isovalue", 60.5, *more)
        assert "a plan and" in line and "cannot be combined" in line
    np.save(hills, HILLS / 7)
    plan.write_text("base\nvalues")
    assert "a plan with values of floats needs a step" in fails(2, *command, "--isovalue", 9.5)
    ok(*command, "--isovalue", 9.5, "--precision", "step=0.1")


def test_a_label_with_a_plan(tmp_path: Path, hills: Path) -> None:
    plan, out = tmp_path / "label.plan", tmp_path / "out.iso"
    plan.write_text("base 3\nrefine")
    ok("encode", hills, "-o", out, "--layers", plan, "--label", 3)
    assert np.array_equal(isocodec.open(out.read_bytes()).above(), HILLS == 3)


def test_a_plan_is_checked_before_the_field_is_encoded() -> None:
    plan = read_plan("base 3\nvalues left=2\nrefine 9\noffsets 3")
    with pytest.raises(OptionError, match="line 4, 'offsets 3': offsets after values"):
        check_plan(plan, [60.5], FULL)


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
