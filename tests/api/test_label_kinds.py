"""The table of operations and files of labels: each cell agrees with the array, or is refused with a remedy."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

import isocodec
from brute import examples
from isocodec import Contour, Field, Frames, IsoFile
from isocodec.api.operations import ViewOptions
from isocodec.errors import IsoError, OptionError
from isocodec.field.labelling import caption, is_of_labels
from isocodec.field.placement import Placement
from isocodec.verbs import Edit
from libraries import Late
from tables import looped

matplotlib = Late("matplotlib")

LABELS = (3, -2, 300)
KINDS = {"one": LABELS[:1], "several": LABELS, "series": LABELS, "tiles": LABELS}
"""Labels of each kind of file; a third of the samples has others, or none."""
SHAPES = {2: (7, 8), 3: (6, 5, 4)}
CASES = [("one", 3), ("several", 2), ("several", 3), ("series", 2), ("tiles", 2)]
PLACED = {2: Placement([[0, 30, 500015], [-20, 3, 4e6]], crs="EPSG:32631"), 3: None}


@cache
def arrays(n: int) -> list[NDArray[Any]]:
    """Two frames, of which the second has one label less."""
    rng = np.random.default_rng(n)
    first = rng.choice(np.array([0, 1, *LABELS], np.int16), SHAPES[n], p=[0.3, 0.1, 0.2, 0.2, 0.2])
    return [first, np.where(first == 300, 0, np.roll(first, 1, axis=0)).astype(np.int16)]


@dataclass(frozen=True)
class Case:
    """A file of labels, with the arrays that it was made from and a folder to write to."""

    kind: str
    n: int
    folder: Path

    @property
    def labels(self) -> tuple[int, ...]:
        return KINDS[self.kind]

    @property
    def frames(self) -> list[NDArray[Any]]:
        return arrays(self.n)[: 2 if self.kind == "series" else 1]

    @property
    def data(self) -> bytes:
        return encoded(self.kind, self.n)

    @property
    def file(self) -> IsoFile:
        return isocodec.open(self.data)

    @property
    def path(self) -> Path:
        path = self.folder / "a.iso"
        path.write_bytes(self.data)
        return path

    @property
    def source(self) -> Path:
        path = self.folder / "a.npy"
        np.save(path, np.stack(self.frames) if self.kind == "series" else self.frames[0])
        return path

    def truth(self, frame: int = 0, labels: Sequence[float] | None = None) -> NDArray[Any]:
        """The array of a frame with only these labels, by default those of the file."""
        values = self.frames[frame]
        return np.where(np.isin(values, self.labels if labels is None else labels), values, 0)


@cache
def encoded(kind: str, n: int, precision: Any = None) -> bytes:
    each = [Field(values, labels=KINDS[kind], placement=PLACED[n]) for values in arrays(n)]
    if kind == "tiles":
        with TemporaryDirectory() as folder:
            isocodec.save(Path(folder, "a.iso"), each[0], tile=32, precision=precision)
            return Path(folder, "a.iso").read_bytes()
    return isocodec.encode(Frames(each) if kind == "series" else each[0], precision=precision)


# -- what the array says ---------------------------------------------------------------------------------------------


def crossings(mask: NDArray[np.bool_]) -> set[tuple[float, ...]]:
    """Middles of the edges between neighbours of which one is in the mask."""
    found = []
    for axis in range(mask.ndim):
        edges = np.argwhere(np.diff(mask, axis=axis)).astype(float)
        edges[:, axis] += 0.5
        found += edges.tolist()
    return set(map(tuple, found))


def on_edges(contour: Contour) -> set[tuple[float, ...]]:
    """The points of a contour on edges along an axis."""
    return set(map(tuple, contour.points[(contour.points % 1 > 0).sum(axis=1) == 1].tolist()))


def agrees(contour: Contour, values: NDArray[Any], label: float) -> None:
    """It is the border of the label in the array."""
    assert contour.isovalue == label and contour.complete
    assert on_edges(contour) == crossings(values == label)


def holds(file: IsoFile, case: Case, labels: Sequence[float] | None = None, box: Any = ...) -> None:
    """A file has these labels in all frames, within a box of the array."""
    labels = case.labels if labels is None else labels
    assert file.complete and file.isovalues == tuple(labels) and file.frames == len(case.frames)
    assert file.metadata["labels"] == " ".join(map(str, labels))
    for frame in range(file.frames):
        assert np.array_equal(file.labels(frame=frame), case.truth(frame, labels)[box])
    for frame, contours in enumerate(file.each_frame()):
        for contour, label in zip(contours, labels, strict=True):
            agrees(contour, case.frames[frame][box], label)


def right_or_refused(file: IsoFile, case: Case) -> None:
    """Labels of a shortened file: those that it still has, or an error."""
    for frame in range(len(case.frames)):
        try:
            found = file.labels(frame=frame)
        except IsoError as error:
            assert error.remedy or error.code == "truncated"
            continue
        assert np.array_equal(found, case.truth(frame, file.isovalues))


def refused(call: Callable[[], object], says: str) -> None:
    with pytest.raises((OptionError, IsoError), match=says) as caught:
        call()
    assert caught.value.remedy or caught.value.code == "kind"


def view(case: Case, file: IsoFile, **options: Any) -> list[Contour]:
    """The contours of the last frame, and each alone, which has the same points on edges unless these were moved."""
    frame = file.frames - 1
    found = file.contours(frame=frame, **options)
    for contour in found:
        alone = file.contour(contour.isovalue, frame=frame, **options)
        assert len(on_edges(alone)) == len(on_edges(contour))
        assert options.get("smooth") or on_edges(alone) == on_edges(contour)
    return found


# -- members of IsoFile ----------------------------------------------------------------------------------------------


def member_info(case: Case) -> None:
    info = case.file.info
    assert info.complete and info.isovalues == list(case.labels) and set(info.leans) == {None}
    assert (info.noun, info.caption(300)) == ("label", "label 300")


def member_isovalues(case: Case) -> None:
    assert case.file.isovalues == case.labels


def member_contour(case: Case) -> None:
    for frame, label in product(range(len(case.frames)), case.labels):
        agrees(case.file.contour(label, frame=frame), case.frames[frame], label)
    refused(lambda: case.file.contour(1), "no label 1")


def member_mesh(case: Case) -> None:
    for frame, label, whole in product(range(len(case.frames)), case.labels, (True, False)):
        mesh, inside = case.file.mesh(label, whole=whole, frame=frame), case.frames[frame] == label
        assert np.array_equal(mesh.above, inside[tuple(mesh.points.astype(int).T)])
        assert not whole or len(mesh.points) == inside.size


def member_above(case: Case) -> None:
    for frame, label in product(range(len(case.frames)), case.labels):
        assert np.array_equal(case.file.above(label, frame=frame), case.frames[frame] == label)


def member_valid(case: Case) -> None:
    assert case.file.valid().all()
    values = np.where(case.frames[0] == 1, np.nan, case.frames[0])
    for missing in ("hole", "below"):
        file = isocodec.open(isocodec.encode(Field(values, labels=case.labels, missing=missing)))
        assert np.array_equal(file.valid(), case.frames[0] != 1 if missing == "hole" else np.ones(values.shape, bool))
        assert np.array_equal(file.labels()[values == values], case.truth()[values == values])
        assert all(one.kept and one.wrong == 0 for one in file.verify(values))


def member_labels(case: Case) -> None:
    holds(case.file, case)
    assert case.file.labels().dtype == np.int16
    refused(lambda: case.file.labels(frame=2), "no frame 2")
    if case.kind == "tiles":
        with pytest.raises(OptionError, match="max_bytes does not apply to curves in tiles"):
            case.file.labels(max_bytes=99)
    else:
        assert np.array_equal(case.file.labels(max_bytes=len(case.data)), case.truth())
        assert np.array_equal(isocodec.open(case.data[:-1]).labels(partial=True), case.truth())
        for size in range(len(case.data) // 3, len(case.data), 29):
            right_or_refused(isocodec.open(case.data[:size]), case)
    if case.n == 2:  # searches take long in space
        right_or_refused(isocodec.open(encoded(case.kind, case.n, 1.0)), case)


def member_verify(case: Case) -> None:
    for frame, values in enumerate(case.frames):
        found = case.file.verify(values, frame=frame if len(case.frames) > 1 else None)
        assert [(one.isovalue, one.kept, one.wrong) for one in found] == [(label, True, 0) for label in case.labels]
        wrong = values.copy()
        wrong.flat[np.flatnonzero(values == 3)[0]] = 0
        first = case.file.verify(wrong, frame=frame)[0]
        assert (first.kept, first.wrong) == (False, 1)
    if case.n == 2:
        within = isocodec.open(encoded(case.kind, case.n, 1.0)).verify(case.frames[0])
        assert all(one.kept and max(one.there, one.back) <= 1.001 for one in within)


def member_edited(case: Case) -> None:
    refused(case.file.edited, "nothing to change")
    part = case.file.edited(window=[(2, 4)] * case.n, isovalues=[3], profile="baseline", layers=99)
    holds(isocodec.open(part), case, (3,), (slice(2, 5),) * case.n)


# -- parameters of contour -------------------------------------------------------------------------------------------


def view_window(case: Case) -> None:
    for contour in view(case, case.file, window=[(1, 3)] * case.n):
        every = crossings(case.frames[-1] == contour.isovalue)
        assert {at for at in every if all(1 <= x <= 3 for x in at)} <= on_edges(contour) <= every


def view_smooth(case: Case) -> None:
    """Points move along their edges, so that samples stay on their sides."""
    if case.kind == "tiles":
        with pytest.raises(OptionError, match="smooth does not apply to curves in tiles"):
            case.file.contours(smooth=True)
        return
    for contour, plain in zip(view(case, case.file, smooth=True), view(case, case.file, smooth=False), strict=True):
        moved = contour.points - plain.points
        along = (plain.points % 1 > 0).sum(axis=1) == 1
        assert np.abs(moved).max() <= 0.5 and not moved[along][plain.points[along] % 1 == 0].any()


# -- parameters of edited --------------------------------------------------------------------------------------------


def edit_layers(case: Case) -> None:
    holds(isocodec.open(case.file.edited(layers=len(case.file.info.layers))), case)
    for layers in range(1, len(case.file.info.layers), 5):
        right_or_refused(isocodec.open(case.file.edited(layers=layers)), case)


def edit_size(case: Case) -> None:
    holds(isocodec.open(case.file.edited(size=len(case.data))), case)
    for size in range(len(case.data) // 2, len(case.data), 19):
        try:
            made = case.file.edited(size=size)
        except OptionError as error:
            assert "too few" in str(error) and error.remedy
            continue
        assert len(made) <= size
        right_or_refused(isocodec.open(made), case)
    coarse = isocodec.open(isocodec.encode(Field(np.kron(case.frames[0], np.ones((4,) * case.n)), labels=case.labels)))
    refused(isocodec.open(coarse.edited(size=coarse.size * 2 // 3)).labels, "coarser")


def edit_window(case: Case) -> None:
    part = isocodec.open(case.file.edited(window=[(3, 4.2)] * case.n))
    holds(part, case, box=(slice(2, 6),) * case.n)
    whole = case.file.contour()
    assert {*map(tuple, part.contour().placed.tolist())} <= {*map(tuple, whole.placed.tolist())}


def edit_isovalues(case: Case) -> None:
    holds(isocodec.open(case.file.edited(isovalues=case.labels[::-1])), case)
    holds(isocodec.open(case.file.edited(isovalues=case.labels[-1:])), case, case.labels[-1:])
    refused(lambda: case.file.edited(isovalues=[1]), "no label 1")


def edit_profile(case: Case) -> None:
    made = isocodec.open(case.file.edited(profile="baseline"))
    holds(made, case)
    assert made.info.profile == "baseline"


def edit_precision(case: Case) -> None:
    fine = isocodec.open(encoded(case.kind, case.n, 0.05))
    holds(isocodec.open(fine.edited(precision="signs")), case)
    if case.n == 2:
        coarse = isocodec.open(fine.edited(precision=1)).verify(case.frames[-1], frame=len(case.frames) - 1)
        assert all(one.kept and one.there <= 1.051 and one.back <= 1.051 for one in coarse)
    for precision in ("exact", "step=1", "0.3 smooth", "2,1"):
        refused(lambda precision=precision: fine.edited(precision=precision), "does not apply")  # type: ignore[misc]


def edit_keep_topology(case: Case) -> None:
    if case.n == 3:
        return
    made = isocodec.open(case.file.edited(precision=1, keep_topology=True))
    for contours, others in zip(made.each_frame(), case.file.each_frame(), strict=True):
        for one, other in zip(contours, others, strict=True):
            assert len(one.lines) == len(other.lines)


# -- the package -----------------------------------------------------------------------------------------------------


def package_encode(case: Case) -> None:
    first = Field(case.frames[0], labels=case.labels)
    for precision in ("exact", "step=1", [2, 1]):
        refused(lambda precision=precision: isocodec.encode(first, precision=precision), "labels")  # type: ignore[misc]
    if case.kind == "one":
        smooth = isocodec.open(isocodec.encode(first, precision="0.3 smooth"))
        assert np.array_equal(smooth.labels(), case.truth()) and smooth.promise == "within 0.3 cells"
        assert all(one.kept for one in smooth.verify(case.frames[0]))
    else:
        refused(lambda: isocodec.encode(first, precision="0.3 smooth"), "could cross")
    if case.kind == "series":
        each = [Field(values, labels=labels) for values, labels in zip(case.frames, [(3,), (3, -2)], strict=True)]
        refused(lambda: isocodec.encode(Frames(each)), "frame 1 has labels that the first frame does not: -2")


def package_merge(case: Case) -> None:
    for values in ([*case.frames], [values == 1 for values in case.frames]):
        other: Any = Frames(values) if case.kind == "series" else values[0]
        for order in (1, -1):
            files = [case.data, isocodec.encode(other, 0.5)][::order]
            refused(lambda files=files: isocodec.merge(files), "cannot be in one file")  # type: ignore[misc]
    each = [Field(values, labels=[1], placement=PLACED[case.n]) for values in case.frames]
    more = isocodec.encode(Frames(each) if case.kind == "series" else each[0])
    for files, labels in (([case.data, more], (*case.labels, 1)), ([more, case.data], (1, *case.labels))):
        holds(isocodec.open(isocodec.merge(files)), case, labels)
    if case.kind == "series":
        both = isocodec.open(isocodec.merge([case.data, case.data]))
        assert both.frames == 2 * case.file.frames
        assert (both.labels(frame=both.frames - 1) == case.file.labels(frame=case.file.frames - 1)).all()
    else:
        refused(lambda: isocodec.merge([case.data, case.data]), "another one in a file before it")


def package_bands(case: Case) -> None:
    refused(lambda: isocodec.bands(case.file.contours()), "bands do not apply to labels" if case.n == 2 else "")


# -- the table -------------------------------------------------------------------------------------------------------

CELLS: dict[str, Callable[[Case], None]] = {
    f"{group} {rest}": cell for name, cell in globals().items()
    for group, _, rest in [name.partition("_")] if group in ("member", "view", "edit", "package")
    and inspect.isfunction(cell) and rest
}
AS_OTHERS = {
    *(f"member {name}" for name in ("size", "data", "promise", "shape", "frames", "metadata", "placement", "crs",
                                    "complete", "contours", "each_frame", "surface", "statistics", "mesh_given",
                                    "window_around", "times", "frame_at", "refreshed")),
    *(f"view {name}" for name in ("frame", "layers", "max_bytes", "within", "through_holes", "partial", "progress",
                                  "bbox")),
    "edit bbox",
    "package save", "package open", "package decode",
}
"""Rows in which files of labels are like any other: test_kinds has them."""
NOT_OF_FILES = {"Contour", "Decoder", "Encoder", "Field", "Frames", "IsoError", "IsoFile", "Limits", "Mesh", "Tin",
                "kernels", "read", "thin"}
"""Names of the package that take no file."""


def test_the_table_is_whole() -> None:
    """Over the lists that the code has: a new member or parameter has no cell yet."""
    rows = [f"member {name}" for name in vars(IsoFile) if not name.startswith("_")]
    rows += [f"view {name}" for name in ViewOptions.__annotations__]
    rows += [f"edit {each.name}" for each in fields(Edit)]
    rows += [f"package {name}" for name in isocodec.__all__ if name not in NOT_OF_FILES]
    assert sorted(rows) == sorted({*CELLS, *AS_OTHERS}) and not AS_OTHERS & {*CELLS}


@looped(("kind", "n"), CASES)
@pytest.mark.parametrize("row", CELLS)
def test_cells(row: str, kind: str, n: int, tmp_path: Path) -> None:
    CELLS[row](Case(kind, n, tmp_path))


# -- words -----------------------------------------------------------------------------------------------------------


def test_captions() -> None:
    for notes, label in (
        ({"labels": "1 2"}, True), ({"labels": "-0.5"}, True), ({}, False), ({"labels": ""}, False),
        ({"labels": "liver spleen"}, False), ({"labels": "1 nan"}, False),
    ):
        assert is_of_labels(notes) is label
        assert caption(1234567, notes) == f"{'label' if label else 'isovalue'} 1234567"
    told = isocodec.open(isocodec.encode(arrays(2)[0], 0.5, metadata={"labels": "liver spleen"}))
    refused(told.labels, "not labels")


# -- random volumes --------------------------------------------------------------------------------------------------


@examples(60)
@given(data=st.data(), seed=st.integers(0, 1 << 20), axes=st.integers(2, 3), count=st.integers(1, 4))
def test_windows_of_random_labels(data: st.DataObject, seed: int, axes: int, count: int) -> None:
    """Enlarged to whole samples and an even start; whatever touches what, labels are those of the array there."""
    rng = np.random.default_rng(seed)
    shape = data.draw(st.lists(st.integers(2, 9), min_size=axes, max_size=axes))
    values = rng.integers(0, count + 1, shape)
    if data.draw(st.booleans()):
        values = np.sort(values, axis=0)
    labels = [int(label) for label in rng.permutation(np.unique(values[values > 0]))]
    assume(labels)
    ends = [sorted(data.draw(st.lists(st.floats(0, size - 1), min_size=2, max_size=2))) for size in shape]
    assume(all(low < high for low, high in ends))
    file = isocodec.open(isocodec.encode(Field(values, labels=labels)))
    part = isocodec.open(file.edited(window=ends))
    low = [min(int(first), size - 2) // 2 * 2 for (first, _), size in zip(ends, shape, strict=True)]
    high = [max(int(np.ceil(last)), start + 1) for (_, last), start in zip(ends, low, strict=True)]
    box = tuple(slice(start, end + 1) for start, end in zip(low, high, strict=True))
    assert np.array_equal(part.labels(), values[box]) and part.isovalues == tuple(labels)
    for contour in part.contours():
        agrees(contour, values[box], contour.isovalue)
