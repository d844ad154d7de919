"""The table of operations and kinds of files: each cell works, or is impossible by nature, with its reason."""

from __future__ import annotations

import inspect
import io
from collections.abc import Callable
from contextlib import nullcontext
from functools import cache
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import isocodec
from isocodec import Decoder, Field, Frames, IsoFile, Limits, Mesh
from isocodec.api.operations import IMPOSSIBLE
from isocodec.errors import InputError, LimitError, OptionError
from isocodec.field.placement import Placement
from isocodec.stream.options import EncodeOptions, ProfileName
from tables import looped

KINDS = ("grid", "series", "mesh", "surface", "tiles")
MOST_IMPOSSIBLE = 11
OPERATIONS = (
    "encode", "save", "open", "info", "contour", "contours", "frames", "above", "valid", "labels", "surface", "mesh",
    "statistics", "verify", "notebook", "layers", "size", "window", "isovalues", "profile", "merge", "decoder",
)
Y, X = np.mgrid[:40, :48]
HILL = ((Y - 17) ** 2 + (X - 20) ** 2 + X * Y % 7).astype(np.int32)
OTHER = HILL + 7
LEVELS = (150.5, 300.5)
POINTS = np.random.default_rng(0).random((300, 2)) * 10
VALUES = np.hypot(*(POINTS - 5).T)
RADII = (2.0, 3.0)
SKEWED = Placement([[3.0, 20.0, 500.0], [-7.0, 1.0, -40.0]], crs="EPSG:32631")
"""Its rows, columns and signs all differ, so that none can stand for another."""


@cache
def encoded(kind: str, values: tuple[float, ...] | None = None) -> bytes:
    """A file of a kind, its notes the values that it is not encoded at by default."""
    notes = {"of": str(values), f"of {values}": "this"}
    given: dict[str, Any] = {"order": "independent", "metadata": notes}
    if kind == "grid":
        return isocodec.encode(Field(HILL, placement=SKEWED), values or LEVELS, precision="exact", **given)
    if kind == "series":
        frames = Frames([Field(each, placement=SKEWED) for each in (HILL, OTHER)])
        return isocodec.encode(frames, values or LEVELS, precision="exact", **given)
    if kind == "mesh":
        # those next to the contours alone: test_needed_points
        return isocodec.encode(Mesh(POINTS, None, VALUES, stored="whole"), values or RADII, **given)
    return isocodec.encode(isocodec.thin(HILL.astype(float), error=5.0, layers=3))


@pytest.fixture(scope="module")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("tiles") / "tiles.iso"
    given: dict[str, Any] = {"precision": "exact", "tile": 32, "metadata": {"of": "None"}}
    isocodec.save(path, Field(HILL, placement=SKEWED), LEVELS, **given)
    return path.read_bytes()


class Slow(io.BytesIO):
    """An open file that gives a few bytes at a time, as pipes and sockets may."""

    def read(self, size: int | None = -1, /) -> bytes:
        return super().read(3 if size is None or not 0 <= size < 3 else size)


def field_of(kind: str) -> Any:
    return Mesh(POINTS, None, VALUES) if kind == "mesh" else HILL.astype(float) if kind == "surface" else HILL


def level_of(kind: str) -> float:
    return RADII[0] if kind == "mesh" else LEVELS[0]


def streamed(data: bytes, kind: str) -> isocodec.Contour:
    """A contour of a file that comes byte by byte."""
    decoder = Decoder()
    for i in range(len(data)):
        decoder.feed(data[i : i + 1])
        list(decoder)
    decoder.close()
    return decoder.contour(isovalue=level_of(kind) if kind == "surface" else None)


def edited(data: bytes, kind: str, **change: Any) -> IsoFile:
    file = isocodec.open(isocodec.open(data).edited(**change))
    assert file.complete
    return file


def check_encode(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    assert file.kind == kind and file.size == len(data) == len(file.data)


def check_save(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    isocodec.save(path / "copy.iso", file)
    assert (path / "copy.iso").read_bytes() == data


def check_open(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    (path / "file.iso").write_bytes(data)
    with (path / "file.iso").open("rb") as stream:
        opened = [isocodec.open(source) for source in (path / "file.iso", str(path / "file.iso"), stream)]
        opened += [isocodec.open(source, limits=Limits(bytes=len(data))) for source in (Slow(data), path / "file.iso")]
    assert {one.kind for one in opened} == {kind} and {one.size for one in opened} == {len(data)}
    for source in (data, path / "file.iso", io.BytesIO(data)):
        with pytest.raises(LimitError):
            isocodec.open(source, limits=Limits(memory=1000)).contour(level_of(kind))
    with pytest.raises(LimitError):
        isocodec.open(io.BytesIO(data), limits=Limits(bytes=len(data) - 1)).contour(level_of(kind))


def check_info(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    info = file.info
    assert (info.kind == kind and info.bytes == len(data) and info.complete and info.layers) or kind == "surface"
    assert 0 < info.overhead_bytes < len(data) and info.as_dict()["kind"] == kind


def check_contour(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    contour = file.contour(level_of(kind))
    assert contour.complete and len(contour.cells) and contour.isovalue == level_of(kind)
    window = [(3.0, 6.0), (2.0, 7.0)] if kind == "mesh" else [(4, 20), (10, 30)]
    part = file.contour(level_of(kind), window=window)
    assert 0 < len(part.cells) < len(contour.cells)
    beginning = file.contour(level_of(kind), max_bytes=len(data) - 1, partial=True)
    assert beginning.points.shape[1] == 2
    assert not file.contour(level_of(kind), max_bytes=len(data) // 2, partial=True).complete
    assert len(file.contour(level_of(kind), layers=99).cells) == len(contour.cells)


def check_contours(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    assert [one.isovalue for one in file.contours()] == list(file.isovalues)


def check_frames(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    frames = list(file.each_frame())
    assert len(frames) == file.frames == (2 if kind == "series" else 1)
    assert all(len(frame) == len(file.isovalues) for frame in frames)


def check_above(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    above = file.above(level_of(kind))
    if kind == "mesh":
        assert above.sum() == (level_of(kind) < VALUES).sum()
    elif kind == "surface":
        assert (above != (level_of(kind) < HILL)).mean() < 0.05
    else:
        assert (above == (level_of(kind) < HILL)).all()


def check_valid(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    valid = file.valid()
    assert valid.all() and valid.shape == ((300,) if kind == "mesh" else HILL.shape)


def check_labels(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    if ("labels", kind) not in IMPOSSIBLE:
        with pytest.raises(OptionError, match="not labels"):
            file.labels()
    else:
        file.labels()
    field = isocodec.Field(HILL // 200 % 3, labels=(1, 2))
    if kind == "grid":
        assert (isocodec.open(isocodec.encode(field)).labels() == field.values).all()


def check_surface(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    tin = file.surface()
    assert np.abs(tin.raster() - HILL).max() <= 5.0


def check_mesh(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    whole, crossed = (file.mesh(level_of(kind), whole=whole) for whole in (True, False))
    assert 0 < len(crossed.cells) < len(whole.cells) and whole.above.any() and not whole.above.all()


def check_statistics(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    found = file.statistics()
    assert len(found.contours) == len(file.isovalues)
    assert 0 < sum(layer.bits for layer in found.layers) <= 8 * max(len(data), file.edited(profile="main").__len__())


def check_verify(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    found = file.verify(field_of(kind))
    assert all(one.kept is not False and not one.wrong for one in found) and len(found) == (len(file.isovalues) or 1)
    wrong = file.verify(field_of(kind), within=1e-12) if kind in ("mesh", "surface") else []
    assert all(not one.kept for one in wrong)
    if kind == "mesh":  # distances are in the unit of the points
        large = isocodec.open(isocodec.encode(Mesh(8 * POINTS, None, VALUES), RADII, precision=2.4))
        small = isocodec.open(isocodec.encode(Mesh(POINTS, None, VALUES), RADII, precision=0.3))
        (one, _), (other, _) = small.verify(field_of(kind)), large.verify(Mesh(8 * POINTS, None, VALUES))
        assert (other.there, other.back) == pytest.approx((8 * one.there, 8 * one.back), rel=0.01) and one.there > 0


def check_notebook(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    page = file._repr_html_()
    assert page.startswith("<") and kind in page


def check_layers(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    assert edited(data, kind, layers=1).size < len(data)


def check_size(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    shorter = edited(data, kind, size=len(data) - 20).size
    assert shorter <= len(data) - 20
    assert edited(data, kind, size=shorter).size == shorter > edited(data, kind, size=shorter - 1).size


def check_window(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    part = edited(data, kind, window=[(4, 20), (10, 30)])
    assert part.shape == (17, 21)
    contour = part.contour()
    far = contour.placed[:, None] - file.contour().placed
    assert len(contour.cells) and np.hypot(*np.moveaxis(far, 2, 0)).min(1).max() < 1e-9


def check_isovalues(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    last = file.isovalues[-1] if file.isovalues else level_of(kind)
    one = edited(data, kind, isovalues=[last])
    assert one.isovalues == (last,)
    assert np.array_equal(np.sort(one.contour().points, axis=0), np.sort(file.contour(last).points, axis=0))


def check_profile(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    same = edited(data, kind, profile="main")
    isovalue = level_of(kind)
    assert len(same.contour(isovalue).cells) == len(file.contour(isovalue).cells)


def check_merge(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    more = (1.0, 4.0) if kind == "mesh" else (50.5, 200.5)
    other = encoded("grid" if kind == "tiles" else kind, more)
    merged = isocodec.open(isocodec.merge([data, other]))
    assert merged.crs == file.crs and (merged.crs is None) == (kind == "mesh")
    assert merged.isovalues == (*file.isovalues, *more) and merged.frames == file.frames
    if merged.crs is not None:
        elsewhere = {"placement": Placement(SKEWED.matrix, crs="EPSG:32632")}
        frames = [Field(each, **elsewhere) for each in (HILL, OTHER)]
        with pytest.raises(InputError, match="crs"):
            isocodec.merge([data, isocodec.encode(Frames(frames) if kind == "series" else frames[0], 99.5)])
    # of notes that both have, the first one's stay
    assert (merged.metadata["of"], merged.metadata[f"of {more}"]) == ("None", "this")
    assert len(merged.contour(more[1]).cells) == len(isocodec.open(other).contour(more[1]).cells) > 0


def check_decoder(file: IsoFile, data: bytes, kind: str, path: Path) -> None:
    assert len(streamed(data, kind).cells) == len(
        list(file.each_frame())[-1][0].cells if kind != "surface" else file.contour(level_of(kind)).cells
    )


CHECKS: dict[str, Callable[[IsoFile, bytes, str, Path], None]] = {
    name.removeprefix("check_"): check for name, check in globals().items() if name.startswith("check_")
}


def test_the_table_is_whole():
    assert set(CHECKS) == set(OPERATIONS)
    assert all(operation in OPERATIONS and kind in KINDS for operation, kind in IMPOSSIBLE)
    assert len(IMPOSSIBLE) <= MOST_IMPOSSIBLE


@looped("kind", KINDS)
@pytest.mark.parametrize("operation", OPERATIONS)
def test_operations(operation: str, kind: str, tmp_path: Path, tiles: bytes):
    data = tiles if kind == "tiles" else encoded(kind)
    file = isocodec.open(data)
    if (operation, kind) in IMPOSSIBLE:
        with pytest.raises((OptionError, isocodec.IsoError)) as caught:
            CHECKS[operation](file, data, kind, tmp_path)
        assert caught.value.remedy or IMPOSSIBLE[operation, kind] in str(caught.value)
        return
    CHECKS[operation](file, data, kind, tmp_path)


WIDE = np.rint(10 * np.hypot(*(np.mgrid[:33, :41] - 15.2))).astype(np.int32)


@pytest.fixture(scope="module")
def uniform(tmp_path_factory: pytest.TempPathFactory) -> dict[str, IsoFile]:
    """Files of uniform meshes from the coarsest on, without offsets."""
    given: dict[str, Any] = {"precision": "signs", "layers": 0}
    path = tmp_path_factory.mktemp("uniform") / "tiles.iso"
    isocodec.save(path, WIDE, 80.5, tile=32, precision="signs")
    return {
        "grid": isocodec.open(isocodec.encode(WIDE, 80.5, **given)),
        "series": isocodec.open(isocodec.encode(Frames([WIDE, WIDE + 1]), 80.5, **given)),
        "several": isocodec.open(isocodec.encode(WIDE, [60.5, 80.5], **given)),
        "tiles": isocodec.open(path),
    }


@looped("kind", ["grid", "series", "several", "tiles"])
@looped("power", range(5))
def test_cubes_as_wide_as_within_are_not_refined(uniform: dict[str, IsoFile], kind: str, power: int) -> None:
    """Exactly as wide, hardly less and hardly more: each second layer halves cubes of 64 samples."""
    widths = [16.0, 4.0, 1.0] if kind == "tiles" else [2.0 ** (6 - i // 2) for i in range(13)]
    for within in (float(2**power), np.nextafter(2**power, 0), np.nextafter(2**power, 99)):
        count = next((i for i, width in enumerate(widths, 1) if width <= within), len(widths))
        found, wanted = uniform[kind].contour(80.5, within=within), uniform[kind].contour(80.5, layers=count)
        assert np.array_equal(found.points, wanted.points) and len(found.cells)
        assert [len(one.points) for one in uniform[kind].contours(within=within)][-1] == len(wanted.points)


GIVEN: dict[str, Any] = {
    "isovalue": 150.5, "simplify": 2, "tile": 64, "engine": object(), "threads": 2, "spool": "spool",
    "precision": "exact", "keep_topology": True, "profile": "baseline", "effort": "best", "layers": 2,
    "order": "isovalues", "interval": 3,
    "metadata": {"a": "b"},
}
"""A value for each parameter of `save`."""
PARAMETERS = [name for name in inspect.signature(isocodec.save).parameters if name not in ("path", "what", "options")]
PARAMETERS += EncodeOptions.__annotations__


@pytest.mark.parametrize("name", [name for name in PARAMETERS if name != "progress"])
@looped("kind", KINDS)
@looped("opened", [False, True])
def test_no_parameter_is_lost_on_what_is_encoded_already(
    opened: bool, kind: str, name: str, tmp_path: Path, tiles: bytes
) -> None:
    data = tiles if kind == "tiles" else encoded(kind)
    for suffix in ("iso", "geojson") if name not in ("isovalue", "simplify") else ("iso",):
        with pytest.raises(OptionError):
            isocodec.save(tmp_path / f"a.{suffix}", isocodec.open(data) if opened else data, **{name: GIVEN[name]})
    assert not list(tmp_path.iterdir())


@looped("profile", get_args(ProfileName))
@looped("kind", [kind for kind in KINDS if ("merge", kind) not in IMPOSSIBLE])
def test_profiles_are_those_asked_for(kind: str, profile: Any, tiles: bytes) -> None:
    """By one file and by several; or it is refused by name."""
    data = tiles if kind == "tiles" else encoded(kind)
    file = isocodec.open(data)
    more = encoded("grid" if kind == "tiles" else kind, (1.0, 4.0) if kind == "mesh" else (50.5, 200.5))
    for way in ("merge", "edit"):
        refused = profile != "main" and (kind == "mesh" or (kind, way) == ("series", "merge"))
        with pytest.raises(OptionError, match="profile") if refused else nullcontext():
            made = isocodec.merge([data, more], profile=profile) if way == "merge" else file.edited(profile=profile)
            assert isocodec.open(made).info.profile == profile


@looped("profile", get_args(ProfileName))
@looped("kind", KINDS)
def test_profiles_of_new_files(kind: str, profile: Any, tmp_path: Path) -> None:
    """A new file has the profile that was asked for, or the kind that cannot have it refuses it by name."""
    refused = profile != "main" and kind in ("mesh", "surface")
    with pytest.raises(OptionError, match=f"profile '{profile}'") if refused else nullcontext():
        if kind == "tiles":
            isocodec.save(tmp_path / "a.iso", HILL, LEVELS, tile=32, profile=profile)
            assert isocodec.open(tmp_path / "a.iso").info.profile == profile
        else:
            what: Any = field_of(kind)
            if kind == "series":
                what = Frames([what, what])
            if kind == "surface":
                what = isocodec.thin(what, to=9)
            data = isocodec.encode(what, None if kind == "surface" else level_of(kind), profile=profile)
            assert isocodec.open(data).info.profile == profile


def test_merged_series_keep_their_profile() -> None:
    files = [isocodec.encode(Frames([HILL, OTHER]), isovalue, profile="baseline") for isovalue in LEVELS]
    with pytest.raises(OptionError, match=r"profile 'main'.*baseline"):
        isocodec.merge(files, profile="main")
    for made in (isocodec.merge(files), isocodec.merge(files, profile="baseline")):
        assert isocodec.open(made).info.profile == "baseline"
