"""Files made of files: held against what the field itself gives, and against distances that shapely measures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import isocodec
from brute import examples
from commands import BALL, HILLS
from explicit_meshes import plane
from files import picture
from grids import polar
from isocodec.errors import InputError, OptionError
from isocodec.field.placement import Placement
from isocodec.format.chunks import write_chunk, write_metadata
from isocodec.format.header import Header, write_header
from isocodec.search.original import original
from isocodec.stream.container import closed
from isocodec.stream.recoder import sources_of
from isospec.container import ChunkType, Profile
from libraries import Late
from tables import looped

KDTree = Late("scipy.spatial.KDTree")
shapely = Late("shapely")

NOISE = picture((23, 18), 7, noise=0.8)
FIELDS = {"hills": (HILLS, 80.5), "noise": (NOISE, 0.5), "ball": (BALL, 55.5)}
PRECISIONS: dict[str, dict[str, Any]] = {
    "exact": {"precision": "exact"}, "default": {}, "fine": {"precision": 0.004}, "signs": {"precision": "signs"}
}


def corners(contour: isocodec.Contour) -> np.ndarray:
    """Cells by the places of their corners, each from the least on, all in order."""
    rows = []
    for cell in contour.points[contour.cells].tolist():
        turn = cell.index(min(cell)) if contour.n == 3 else 0
        rows.append([x for corner in cell[turn:] + cell[:turn] for x in corner])
    return np.array(sorted(rows))


def same(a: isocodec.Contour, b: isocodec.Contour) -> bool:
    return np.array_equal(corners(a), corners(b)) and a.isovalue == b.isovalue


def apart(a: isocodec.Contour, b: isocodec.Contour) -> float:
    """The largest distance of two curves, both ways, by shapely of many points in between."""
    one, two = (c.to_shapely() for c in (a, b))

    def farthest(line: shapely.Geometry, other: shapely.Geometry) -> float:
        points = shapely.points(shapely.get_coordinates(shapely.segmentize(line, 0.02)))
        return float(shapely.distance(points, other).max())

    return max(farthest(one, two), farthest(two, one))


@pytest.mark.cover(2)
@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("profile", ["main", "baseline"])
@pytest.mark.parametrize(
    "asked", [{"precision": "exact"}, {"precision": "signs"}, {"precision": 0.03}, {"precision": 0.05}], ids=str
)
def test_exact_files_give_what_their_field_gives(name: str, profile: str, asked: dict[str, Any]) -> None:
    """Byte by byte: a file of all values next to the curve is as good as the field."""
    field, isovalue = FIELDS[name]
    whole = isocodec.encode(field, isovalue, precision="exact", metadata={"unit": "m"})
    how = {} if asked["precision"] == "exact" else asked
    made = isocodec.open(whole).edited(profile=profile, **how)
    assert made == isocodec.encode(field, isovalue, profile=profile, metadata={"unit": "m"}, **asked)


def test_steps_of_floats() -> None:
    field = np.sin(np.mgrid[:20, :30][0] / 3.0) + np.cos(np.mgrid[:20, :30][1] / 4.0)
    whole = isocodec.encode(field, 0.2, precision="step=0.01")
    assert isocodec.open(whole).edited(profile="baseline") == isocodec.encode(
        field, 0.2, precision="step=0.01", profile="baseline",
    )


@pytest.mark.cover(2)
@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("there", ["main", "baseline"])
def test_no_point_moves(name: str, precision: str, there: str) -> None:
    """From either profile to the other and back."""
    field, isovalue = FIELDS[name]
    here = "baseline" if there == "main" else "main"
    data = isocodec.encode(field, isovalue, profile=here, **PRECISIONS[precision])
    made = isocodec.open(data).edited(profile=there)
    assert isocodec.open(made).info.profile == there
    assert same(isocodec.decode(made), isocodec.decode(data))
    assert np.array_equal(isocodec.open(made).above(), field > isovalue)
    assert isocodec.open(made).edited(profile=here) == isocodec.open(data).edited(profile=here)


@looped("tolerance", [0.03, 0.2, 1.0])
@looped("precision", PRECISIONS)
def test_distances_are_kept(precision: str, tolerance: float) -> None:
    """Between the curve of the file and that of the result."""
    for field, isovalue in (FIELDS["hills"], FIELDS["noise"])[: 1 + (tolerance == 0.2)]:
        data = isocodec.encode(field, isovalue, **PRECISIONS[precision])
        made = isocodec.open(data).edited(precision=tolerance)
        assert apart(isocodec.decode(made), isocodec.decode(data)) <= tolerance + 1e-9


@looped("precision", PRECISIONS)
@looped("name", FIELDS)
def test_the_searches_start_from_the_curve_of_the_file(name: str, precision: str) -> None:
    """What distances are proven from is what a decoder draws."""
    field, isovalue = FIELDS[name]
    data = isocodec.encode(field, isovalue, **PRECISIONS[precision])
    decoder = isocodec.Decoder()
    decoder.feed(data)
    (source,) = sources_of(decoder.take())
    assert same(original(source.field), isocodec.decode(data))


def test_missing_samples_and_place() -> None:
    field = HILLS.astype(float)
    field[5:9, 12:20] = np.nan
    place = np.array([[0.0, 30, 5e5], [-20, 0, 5e6]])
    data = isocodec.encode(isocodec.Field(field, placement=place), 80.25, metadata={"crs": "EPSG:32631"})
    made = isocodec.open(data).edited(profile="baseline")
    assert np.array_equal(isocodec.open(made).valid(), ~np.isnan(field))
    before, after = (isocodec.decode(d) for d in (data, made))
    assert same(before, after) and after.metadata == before.metadata
    assert np.array_equal(np.sort(after.placed, axis=0), np.sort(before.placed, axis=0))
    assert isocodec.decode(isocodec.open(data).edited(precision=0.5)).masked


@looped("seed", range(6))
def test_values_beside_scattered_holes(seed: int) -> None:
    """Edges that no cell without missing samples has tell nothing (spec 5.10.4), and nothing is asked of them."""
    rng = np.random.default_rng(seed)
    field = rng.integers(0, 9, (14, 17) if seed % 2 else (6, 7, 8))
    masked = np.ma.masked_array(field, mask=rng.random(field.shape) < [0.1, 0.4, 0.7][seed % 3])
    data = isocodec.encode(masked, 4.5, precision="exact")
    made = isocodec.open(data).edited(profile="baseline")
    assert same(isocodec.decode(data), isocodec.decode(made))


def test_files_that_cannot_be() -> None:
    coarse = isocodec.encode(HILLS, 80.5, layers="topology")
    series = isocodec.encode(isocodec.Frames([HILLS, HILLS]), 80.5)
    mapped, coordinates = polar()
    ring = isocodec.encode(isocodec.Field(mapped, placement=Placement(coordinates=coordinates, periodic=1)), 0.0)
    part = isocodec.encode(HILLS, 80.5, layers=[("base", 2), ("refine", None), ("values", 2)])
    surface = isocodec.encode(isocodec.thin(HILLS.astype(float), error=20.0))
    points = np.random.default_rng(1).random((50, 2))
    mesh = isocodec.encode(isocodec.Mesh(points, None, points[:, 0]), 0.5)
    reasons = {
        coarse: ("coarser", "coarser"), ring: ("coordinates", "coordinates"), part: ("in part", "in part"),
        mesh: ("meshes", "differs from the first in kind"), surface: ("surfaces", "triangulated surfaces"),
    }
    for data, (edited, merged) in reasons.items():
        with pytest.raises(OptionError, match=edited):
            isocodec.open(data).edited(profile="baseline")
        with pytest.raises(OptionError if data is not mesh else InputError, match=merged):
            isocodec.merge([isocodec.encode(HILLS, 90.5), data])
    with pytest.raises(InputError, match="differs from the first in its frames"):
        isocodec.merge([isocodec.encode(HILLS, 90.5), series])
    with pytest.raises(OptionError, match="precision 'exact' does not apply to edits"):
        isocodec.open(series).edited(precision="exact")
    with pytest.raises(isocodec.errors.TruncatedError):
        isocodec.open(isocodec.encode(HILLS, 80.5)[:-9]).edited(profile="baseline")
    with pytest.raises(OptionError, match="layers and size cannot be combined"):
        isocodec.open(isocodec.encode(HILLS, 80.5)).edited(layers=1, size=900)


def test_no_point_of_a_series_moves() -> None:
    data = isocodec.encode(isocodec.Frames([HILLS, HILLS[::-1]]), 80.5)
    made = isocodec.open(data).edited(profile="baseline")
    for frame in (0, 1):
        assert same(isocodec.decode(made, frame=frame), isocodec.decode(data, frame=frame))


# ---- Several in one -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", ["main", "baseline"])
def test_merged(profile: str) -> None:
    """Whatever each of them tells; the isovalues lean on one another."""
    asked: list[tuple[list[float], dict[str, Any]]] = [
        ([40.5], {}), (
            [80.5, 120.5], {"precision": "exact"},
        ), ([60.5], {"precision": "signs"}), ([100.5], {"precision": 0.01})
    ]
    files = [isocodec.encode(HILLS, isovalues, **options) for isovalues, options in asked]
    made = isocodec.merge(files, profile=profile)
    before = [contour for file in files for contour in isocodec.open(file).contours()]
    after = isocodec.open(made).contours()
    assert [contour.isovalue for contour in after] == [40.5, 80.5, 120.5, 60.5, 100.5]
    assert all(map(same, after, before))
    if profile == "main":
        assert len(made) < sum(map(len, files))


@examples(12)
@given(
    st.integers(0, 10_000), st.sampled_from([{}, {"precision": "exact"}, {"precision": "signs"}, {"precision": 0.2}]),
)
def test_merged_whatever_the_field(seed: int, options: dict[str, Any]) -> None:
    """Of isovalues so close that crossings of one edge coincide, or were moved past one another."""
    rng = np.random.default_rng(seed)
    field = rng.integers(0, 4, (9, 8))
    options = {**options, "layers": 0} if options.get("precision") == 0.2 else options
    files = [isocodec.encode(field, value, **options) for value in (1.45, 1.5, 0.5, 2.5)]
    for profile in ("main", "baseline"):
        after = isocodec.open(isocodec.merge(files, profile=profile)).contours()
        assert all(map(same, after, map(isocodec.decode, files)))


def test_files_on_one_mesh() -> None:
    """Of three files the isovalues lean on those that they leant on before."""
    mesh = plane(2, 200)
    values = np.rint(mesh[0].sum(axis=1)).astype(int)
    files = [isocodec.encode(isocodec.Mesh(*mesh, values), [low + 0.5, low + 2.5]) for low in (60, 90, 120)]
    assert all(isocodec.open(file, mesh=mesh).info.leans == [None, 0] for file in files)
    made = isocodec.open(isocodec.merge(files), mesh=mesh)
    assert made.info.leans == [None, 0, None, 2, None, 4]
    before = [contour for file in files for contour in isocodec.open(file, mesh=mesh).contours()]
    assert all(map(same, made.contours(), before))


def test_not_of_one_field() -> None:
    here = isocodec.encode(isocodec.Field(HILLS, placement=[1.0, 2.0]), 80.5)
    holes = np.zeros(HILLS.shape, bool)
    holes[3, 3] = True
    others = {
        "shape": isocodec.encode(isocodec.Field(HILLS[:-1], placement=[1.0, 2.0]), 90.5),
        "differs from the first in placement": isocodec.encode(isocodec.Field(HILLS, placement=[1.0, 3.0]), 90.5),
        "missing": isocodec.encode(isocodec.Field(HILLS, mask=holes, placement=[1.0, 2.0]), 90.5),
        "not of the same field": isocodec.encode(isocodec.Field(HILLS[::-1], placement=[1.0, 2.0]), 90.5),
    }
    for says, other in others.items():
        with pytest.raises(InputError, match=says):
            isocodec.merge([here, other])
    smooth = HILLS.astype(float)
    with pytest.raises(InputError, match="steps"):
        isocodec.merge(
            [isocodec.encode(smooth, 80.5, precision="step=0.5"), isocodec.encode(smooth, 90.5, precision="step=0.25")]
        )
    with pytest.raises(OptionError, match="in two of the files"):
        isocodec.merge([here, here])
    with pytest.raises(OptionError, match="no files"):
        isocodec.merge([])


# ---- Command line ---------------------------------------------------------------------------------------------------


@looped("asked", [[80.5, 60.5], [60.5, 80.5], [100.5, 80.5, 80.5], [100.5]], ids=str)
@looped("order", ["isovalues", "independent"])
def test_isovalues_that_are_kept_stay_in_the_order_of_the_file(asked: list[float], order: str) -> None:
    """Each once, in whatever order they are named."""
    file = isocodec.open(isocodec.encode(HILLS, [60.5, 100.5, 80.5], precision="exact", order=order))
    made = isocodec.open(file.edited(isovalues=asked))
    assert made.isovalues == tuple(value for value in file.isovalues if value in asked)
    for value in made.isovalues:
        assert same(made.contour(value), file.contour(value))


@pytest.mark.parametrize("notes", [{}, {"title": "nothing"}], ids=str)
def test_isovalues_of_a_file_without_layers(notes: dict[str, str]) -> None:
    header = write_header(Header((17, 17), 5.5, None, Profile.MAIN))
    last = write_chunk(ChunkType.METADATA, write_metadata(notes), ancillary=True, last=True)
    file = isocodec.open(b"".join(closed([header, last])))
    made = isocodec.open(file.edited(isovalues=[5.5]))
    assert (made.isovalues, made.metadata, made.complete) == ((5.5,), notes, True)
    assert not len(made.contour().points)
