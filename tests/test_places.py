"""Where curves, surfaces and masks lie, whatever the samples came in: geometry x container x output.

Places of samples are those that the container's own library gives, held against the geometry by hand; points of a curve
or surface lie between two samples, by linear interpolation.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import geopandas
import nibabel
import numpy as np
import pydicom
import pytest
import pyvista
import rasterio
import SimpleITK
import tifffile
import trimesh
import xarray
from pydicom import Dataset
from pydicom.dataset import FileMetaDataset
from pydicom.uid import CTImageStorage, EnhancedCTImageStorage, ExplicitVRLittleEndian, generate_uid

import isocodec
from commands import ok
from isocodec.errors import OptionError
from isocodec.field.placement import LPS, Placement
from isocodec.io.formats import OutputOptions, SampleMask, write

Array = np.ndarray
SHAPE = (6, 7, 5)
LEVEL = 50.5
WITHIN = 1e-4
"""Of the least distance of neighbouring samples."""
FLIP = np.array([-1.0, -1.0, 1.0])
"""From left, back, up to right, front, up, and back."""


def blob(shape: tuple[int, ...]) -> Array:
    """A body like no mirror image of its own, in the middle; of a slice its middle."""
    i, j, k = np.indices(SHAPE)
    values = 110 - 16 * np.sqrt((i - 2.2) ** 2 + 0.8 * (j - 3.3) ** 2 + 1.3 * (k - 1.9) ** 2) - 3 * i + 2 * j * (k - 2)
    cut = tuple(slice(2, 3) if size == 1 else slice(None) for size in shape)
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)[cut]


def matrix(*columns: tuple[float, float, float]) -> Array:
    """Steps along i, j, k and the place of the first sample, as columns."""
    return np.array(columns).T.astype(np.float64)


TURN = nibabel.eulerangles.euler2mat(0.4, -0.3, 0.2)
STEPS, START = np.diag([0.8, 1.25, 2.0]), np.array([-30.5, 12.25, 7.0])
LINES = matrix((0.8, 0, 0), (0, 1.25, 0), (0, 0, 2), (-30.5, 12.25, 7))
OBLIQUE = np.column_stack([TURN @ STEPS, START])
GEOMETRIES: dict[str, tuple[Array, tuple[int, ...]]] = {
    "identity": (np.eye(3, 4), SHAPE),
    "spacing": (np.column_stack([STEPS, np.zeros(3)]), SHAPE),
    "origin": (np.column_stack([np.eye(3), START]), SHAPE),
    "flipped": (matrix((-0.8, 0, 0), (0, -1.25, 0), (0, 0, 2), (4, 5, -6)), SHAPE),
    "oblique": (OBLIQUE, SHAPE),
    "sheared": (matrix((0.8, 0.1, 0), (0.3, 1.2, 0.1), (0, -0.2, 2), (1, -2, 3)), SHAPE),
    "left-handed": (matrix((0.8, 0, 0), (0, 1.25, 0), (0, 0, -2), (3, 2, 1)), SHAPE),
    "gantry tilt": (matrix((0.8, 0, 0), (0, 1.25 * 0.96, 1.25 * 0.28), (0, 0, 2), (-7, 8, 9)), SHAPE),
    "slice along i": (LINES, (1, 7, 5)),
    "slice along j": (LINES, (6, 1, 5)),
    "slice along k": (LINES, (6, 7, 1)),
    "plane in space": (OBLIQUE, (6, 7, 1)),
}


class Made:
    """Samples in a container.

    Attributes
    ----------
    thing : path or object
    places : (s0, s1, s2, 2 or 3) array
        Coordinates of the samples, by the container's library.
    body : str or None
        Where they run in a body, by the definition of the container.
    """

    def __init__(self, thing: Any, places: Array, body: str | None = None) -> None:
        self.thing, self.places, self.body = thing, places, body


def by_hand(at: Array, shape: tuple[int, ...]) -> Array:
    """Coordinates of samples (i, j, k) by a matrix."""
    return np.moveaxis(np.tensordot(at[:, :3], np.indices(shape), 1), 0, -1) + at[:, 3]


# ---- Containers -----------------------------------------------------------------------------------------------------


def slice_header(storage: str, values: Array) -> Dataset:
    """What a file of one slice, or of several, has: columns are i, rows j."""
    made = Dataset()
    meta = made.file_meta = FileMetaDataset()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    meta.MediaStorageSOPClassUID = made.SOPClassUID = storage
    meta.MediaStorageSOPInstanceUID = made.SOPInstanceUID = generate_uid()
    made.SeriesInstanceUID, made.StudyInstanceUID, made.FrameOfReferenceUID = "1.2.3", "1.2.4", "1.2.5"
    made.Modality, made.PatientID, made.PatientName = "CT", "", ""
    made.Columns, made.Rows = values.shape[:2]
    made.SamplesPerPixel, made.PhotometricInterpretation = 1, "MONOCHROME2"
    made.BitsAllocated = made.BitsStored = 16
    made.HighBit, made.PixelRepresentation = 15, 0
    return made


def decimals(numbers: Array) -> list[str]:
    return [f"{number:.10f}" for number in numbers]


def geometry_of_slice(at: Array, k: int) -> dict[str, list[str]]:
    """The attributes that place slice k."""
    steps = np.linalg.norm(at[:, :2], axis=0)
    return {
        "PixelSpacing": decimals(steps[::-1]), "ImageOrientationPatient": decimals((at[:, :2] / steps).T.ravel()),
        "ImagePositionPatient": decimals(at[:, 3] + k * at[:, 2]),
    }


def pixels(values: Array) -> bytes:
    """Slices one after the other, rows of them."""
    return values.T.astype("<u2").tobytes()


def by_attributes(position: Any, orientation: Any, spacing: Any, size: tuple[int, int]) -> Array:
    """Coordinates of the samples (i, j) of a slice, by DICOM PS3.3 C.7.6.2.1.1."""
    along, down = np.array(orientation, float).reshape(2, 3)
    i, j = np.indices(size)[..., None]
    return np.array(position, float) + along * float(spacing[1]) * i + down * float(spacing[0]) * j


def dicom(folder: Path, at: Array, values: Array) -> Made:
    """A folder, names of its files in another order than slices."""
    where = folder / "dicom"
    where.mkdir()
    places = []
    for k in range(values.shape[2]):
        made = slice_header(CTImageStorage, values)
        made.InstanceNumber, made.RescaleSlope, made.RescaleIntercept = k + 1, 1, 0
        for name, numbers in geometry_of_slice(at, k).items():
            setattr(made, name, numbers)
        made.PixelData = pixels(values[:, :, k])
        made["PixelData"].VR = "OW"
        path = where / f"{(3 * k) % 7}.dcm"
        made.save_as(path, enforce_file_format=True)
        back = pydicom.dcmread(path)
        places.append(by_attributes(back.ImagePositionPatient, back.ImageOrientationPatient, back.PixelSpacing,
                                    values.shape[:2]))
    return Made(where, np.stack(places, axis=2), "LPS")


def enhanced(folder: Path, at: Array, values: Array) -> Made:
    """One file of several frames, with groups of attributes for each."""
    made = slice_header(EnhancedCTImageStorage, values)
    made.ImageType, made.InstanceNumber, made.NumberOfFrames = ["ORIGINAL", "PRIMARY", "VOLUME", "NONE"], 1, len(
        values.T)
    frames = []
    for k in range(values.shape[2]):
        found = geometry_of_slice(at, k)
        frame, groups = Dataset(), {
            "PlanePositionSequence": ["ImagePositionPatient"], "PlaneOrientationSequence": ["ImageOrientationPatient"],
            "PixelMeasuresSequence": ["PixelSpacing"],
        }
        for group, names in groups.items():
            inner = Dataset()
            for name in names:
                setattr(inner, name, found[name])
            setattr(frame, group, [inner])
        content, rescaled = Dataset(), Dataset()
        content.StackID, content.InStackPositionNumber = "1", k + 1
        rescaled.RescaleSlope, rescaled.RescaleIntercept, rescaled.RescaleType = 1, 0, "HU"
        frame.FrameContentSequence, frame.PixelValueTransformationSequence = [content], [rescaled]
        frames.append(frame)
    made.PerFrameFunctionalGroupsSequence, made.SharedFunctionalGroupsSequence = frames, [Dataset()]
    made.PixelData = pixels(values)
    made["PixelData"].VR = "OW"
    path = folder / "enhanced.dcm"
    made.save_as(path, enforce_file_format=True)
    places = [
        by_attributes(
            each.PlanePositionSequence[0].ImagePositionPatient,
            each.PlaneOrientationSequence[0].ImageOrientationPatient, each.PixelMeasuresSequence[0].PixelSpacing,
            values.shape[:2],
        ) for each in pydicom.dcmread(path).PerFrameFunctionalGroupsSequence
    ]
    return Made(path, np.stack(places, axis=2), "LPS")


def nibabel_image(_: Path, at: Array, values: Array) -> Made:
    image = nibabel.Nifti1Image(values, np.vstack([at, [0, 0, 0, 1]]))
    places = nibabel.affines.apply_affine(image.affine, np.moveaxis(np.indices(values.shape), 0, -1))
    return Made(image, places, "RAS")


def nifti(folder: Path, at: Array, values: Array) -> Made:
    path = folder / "volume.nii.gz"
    nibabel.save(nibabel_image(folder, at, values).thing, path)
    indices = np.moveaxis(np.indices(values.shape), 0, -1)
    return Made(path, nibabel.affines.apply_affine(nibabel.load(path).affine, indices), "RAS")


def itk_places(image: Any) -> Array:
    size = image.GetSize()
    return np.array([
        image.TransformIndexToPhysicalPoint([int(n) for n in index]) for index in np.ndindex(*size)
    ]).reshape(*size, 3)


def itk_image(_: Path, at: Array, values: Array) -> Made:
    image = SimpleITK.GetImageFromArray(np.ascontiguousarray(values.T))
    steps = np.linalg.norm(at[:, :3], axis=0)
    image.SetSpacing(steps.tolist())
    image.SetDirection((at[:, :3] / steps).ravel().tolist())
    image.SetOrigin(at[:, 3].tolist())
    return Made(image, itk_places(image), "LPS")


def itk_file(name: str) -> Callable[[Path, Array, Array], Made]:
    def made(folder: Path, at: Array, values: Array) -> Made:
        SimpleITK.WriteImage(itk_image(folder, at, values).thing, folder / name)
        return Made(folder / name, itk_places(SimpleITK.ReadImage(folder / name)), "LPS")

    return made


def vtk_image(_: Path, at: Array, values: Array) -> Made:
    """Its extent does not begin at 0."""
    steps, first = np.linalg.norm(at[:, :3], axis=0), np.array([2, -1, 3])
    grid = pyvista.ImageData(dimensions=values.shape, spacing=steps)
    grid.direction_matrix = at[:, :3] / steps
    grid.origin = at[:, 3] - at[:, :3] @ first
    grid.extent = np.stack([first, first + values.shape - 1], axis=1).ravel()
    grid["f"] = values.ravel(order="F")
    places = np.array([grid.GetPoint(n) for n in range(values.size)]).reshape(*values.shape, 3, order="F")
    return Made(grid, places)


def vti(folder: Path, at: Array, values: Array) -> Made:
    vtk_image(folder, at, values).thing.save(folder / "grid.vti")
    grid = pyvista.read(folder / "grid.vti")
    places = np.array([grid.GetPoint(n) for n in range(values.size)]).reshape(*values.shape, 3, order="F")
    return Made(folder / "grid.vti", places)


def npz(folder: Path, at: Array, values: Array) -> Made:
    """A matrix with a row for each coordinate and a column for each axis that is left."""
    kept = [axis for axis in range(3) if values.shape[axis] > 1]
    np.savez(folder / "field.npz", values=values.squeeze(), placement=at[:, [*kept, 3]])
    return Made(folder / "field.npz", by_hand(np.load(folder / "field.npz")["placement"] if len(kept) == 3 else at,
                                              values.shape))


def geotiff(folder: Path, at: Array, values: Array) -> Made:
    """The middle slice: columns are i, rows j; two coordinates."""
    values = values[:, :, 2:3]
    # corners of pixels: samples lie in the middle
    corner = at[:2, 3] - at[:2, :2] @ [0.5, 0.5]
    flat = [*at[0, :2], 0, corner[0], *at[1, :2], 0, corner[1], 0, 0, 0, 0, 0, 0, 0, 1]
    keys = (34735, "H", 8, (1, 1, 0, 1, 1025, 0, 1, 1))
    tifffile.imwrite(folder / "map.tif", values[:, :, 0].T, photometric="minisblack",
                     extratags=[(34264, "d", 16, tuple(map(float, flat))), keys])
    with rasterio.open(folder / "map.tif") as file:
        i, j = np.indices(values.shape[:2])
        x, y = file.transform @ (i + 0.5, j + 0.5)
    return Made(folder / "map.tif", np.stack([x, y], axis=-1)[:, :, None], None)


def data_array(_: Path, at: Array, values: Array) -> Made:
    """Axes z, y, x with coordinates; the one of a single sample is a note, not a coordinate of the curve."""
    along = [at[c, c] * np.arange(values.shape[c]) + at[c, 3] for c in range(3)]
    array = xarray.DataArray(values.T, dims=("z", "y", "x"), coords=dict(zip("xyz", along, strict=True)))
    kept = [c for c in range(3) if values.shape[c] > 1]
    places = np.stack([each.transpose("x", "y", "z") for each in xarray.broadcast(*(array[n] for n in "xyz"))], axis=-1)
    return Made(array, places[..., kept])


CONTAINERS: dict[str, Callable[[Path, Array, Array], Made]] = {
    "DICOM": dicom, "enhanced DICOM": enhanced, "NIfTI": nifti, "NRRD": itk_file("volume.nrrd"),
    "MetaImage": itk_file("volume.mha"), "VTI": vti, "GeoTIFF": geotiff, "NPZ": npz, "SimpleITK": itk_image,
    "nibabel": nibabel_image, "pyvista": vtk_image, "xarray": data_array,
}


@cache
def encoded(geometry: str, container: str) -> tuple[isocodec.IsoFile, Made, Array]:
    """The file of a geometry in a container, the container, and its samples."""
    at, shape = GEOMETRIES[geometry]
    values = blob(shape)
    with TemporaryDirectory() as folder:
        made = CONTAINERS[container](Path(folder), at, values)
        field = isocodec.read(made.thing)
    values = values[:, :, 2:3] if container == "GeoTIFF" else values
    return isocodec.open(isocodec.encode(field, LEVEL, precision="exact")), made, values


def crossings(made: Made, values: Array) -> Array:
    """Points of the curve or surface, between a sample above and a neighbour that is not."""
    found = []
    for axis in range(3):
        size = values.shape[axis]
        a, b = (np.take(values.astype(float), range(n, size - 1 + n), axis) for n in (0, 1))
        at, to = (np.take(made.places, range(n, size - 1 + n), axis) for n in (0, 1))
        cut = (a > LEVEL) != (b > LEVEL)
        part = ((LEVEL - a) / np.where(cut, b - a, 1))[..., None]
        found.append((at + part * (to - at))[cut])
    return np.concatenate(found)


# ---- Outputs: points and where they run in a body, as the file states it --------------------------------------------


def stated(text: bytes) -> str | None:
    return next((name for name in ("RAS", "LPS") if f"SPACE={name}".encode() in text), None)


def of_trimesh(path: Path) -> tuple[Array, str | None]:
    head = path.read_bytes()[:300]
    return np.asarray(trimesh.load(path, process=False).vertices), stated(head)


def of_glb(path: Path) -> tuple[Array, str | None]:
    """Nodes moved as they state. Turned back if the scene states that its up is y, as that of the format is."""
    data = path.read_bytes()
    scene = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])["scenes"][0]
    points = np.asarray(trimesh.load(path, process=False).to_geometry().vertices)
    extras = scene.get("extras", {})
    if extras.get("up") == "y":
        points = points @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    return points, extras.get("SPACE")


def of_vtp(path: Path) -> tuple[Array, str | None]:
    found = pyvista.read(path)
    return np.asarray(found.points), found.field_data["SPACE"][0] if "SPACE" in found.field_data else None


def of_geojson(path: Path) -> tuple[Array, str | None]:
    feature = json.loads(path.read_text())
    short = {"right-anterior-superior": "RAS", "left-posterior-superior": "LPS", None: None}
    return np.concatenate(feature["geometry"]["coordinates"]), short[feature.get("space")]


def of_nifti(path: Path) -> tuple[Array, str | None]:
    image = nibabel.load(path)
    return nibabel.affines.apply_affine(image.affine, np.argwhere(np.asarray(image.dataobj))), "RAS"


def of_nrrd(path: Path) -> tuple[Array, str | None]:
    image = SimpleITK.ReadImage(path)
    assert b"\nspace: left-posterior-superior\n" in path.read_bytes()
    return itk_places(image)[SimpleITK.GetArrayFromImage(image).T > 0], "LPS"


SURFACES: dict[str, Callable[[Path], tuple[Array, str | None]]] = {
    ".stl": of_trimesh, ".ply": of_trimesh, ".glb": of_glb, ".vtp": of_vtp,
}
CURVES: dict[str, Callable[[Path], tuple[Array, str | None]]] = {".vtp": of_vtp, ".geojson": of_geojson}
MASKS: dict[str, Callable[[Path], tuple[Array, str | None]]] = {".nii.gz": of_nifti, ".nrrd": of_nrrd}
OUTPUTS = (*SURFACES, ".geojson", *MASKS, ".npy")


def impossible(geometry: str, container: str, output: str) -> str:
    """Why a cell cannot be; empty if it can."""
    flat = 1 in GEOMETRIES[geometry][1] or container == "GeoTIFF"
    if container == "GeoTIFF" and (1 in GEOMETRIES[geometry][1] or geometry == "gantry tilt"):
        return "a map has two axes and two coordinates"
    if geometry == "sheared" and "DICOM" in container:
        return "rows and columns of DICOM are at right angles"
    if container == "xarray" and geometry in ("oblique", "sheared", "gantry tilt", "plane in space"):
        return "coordinates along axes do not turn them"
    if flat and output in SURFACES and output not in CURVES:
        return "a curve has no triangles"
    if not flat and output not in SURFACES and output in CURVES:
        return "GeoJSON has no surfaces"
    return ""


def cells() -> list[Any]:
    found = []
    for geometry in GEOMETRIES:
        for container in CONTAINERS:
            for output in OUTPUTS:
                if not impossible(geometry, container, output):
                    found.append(pytest.param(geometry, container, output,
                                              id=f"{geometry}-{container}-{output}"))
    return found


CELLS = cells()


def test_cells() -> None:
    """Every cell is tried, or has a reason why it cannot be."""
    every = [(g, c, o) for g in GEOMETRIES for c in CONTAINERS for o in OUTPUTS]
    reasons = [cell for cell in every if impossible(*cell)]
    assert len(CELLS) + len(reasons) == len(every) and len(CELLS) >= 250


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_libraries_place_samples_as_by_hand(tmp_path: Path, geometry: str, container: str) -> None:
    if all(impossible(geometry, container, output) for output in OUTPUTS):
        return
    at, shape = GEOMETRIES[geometry]
    made = CONTAINERS[container](tmp_path, at, blob(shape))
    expected = by_hand(at, shape)
    if container == "GeoTIFF":
        expected = by_hand(at * [1, 1, 0, 1], made.places.shape[:3])[..., :2]
    elif container == "xarray":
        expected = expected[..., [axis for axis in range(3) if shape[axis] > 1]]
    assert np.allclose(made.places, expected, rtol=0, atol=1e-5)


def least(made: Made) -> float:
    """The least distance of neighbouring samples."""
    steps = [np.linalg.norm(np.diff(made.places, axis=axis), axis=-1) for axis in range(3)]
    return min(float(step.min()) for step in steps if step.size)


def farthest(found: Array, expected: Array) -> float:
    """The farthest that a point of one set lies from the other."""
    apart = np.linalg.norm(found[:, None] - expected[None], axis=-1)
    return float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))


@pytest.mark.parametrize(("geometry", "container", "output"), CELLS)
def test_places(tmp_path: Path, geometry: str, container: str, output: str) -> None:
    file, made, values = encoded(geometry, container)
    path, surface = tmp_path / f"out{output}", output in SURFACES or output in CURVES
    if surface:
        write(path, file.contour(), options=OutputOptions(keep_crs=True))
        found, body = (SURFACES | CURVES)[output](path)
        expected = crossings(made, values)
    else:
        above = file.above()
        write(path, SampleMask(above, file.placement))
        if output == ".npy":
            assert file.placement is not None
            found, body = file.placement.place(np.argwhere(np.load(path)).astype(float)), file.placement.space
        else:
            found, body = MASKS[output](path)
        expected = made.places[values > LEVEL]
    if found.shape[1] > expected.shape[1]:
        expected = np.pad(expected, ((0, 0), (0, 1)))
    if made.body is not None:
        assert body is not None
        expected = expected * FLIP if body != made.body else expected
    elif output in MASKS:
        # what does not lie in a body is written as if x, y, z were right, front, up
        expected = expected * FLIP if body == "LPS" else expected
    else:
        assert body is None
    assert found.shape[1] == expected.shape[1]
    assert farthest(found, expected) <= WITHIN * least(made)
    if surface and output != ".stl":  # triangles of it have points of their own
        assert len(np.unique(found, axis=0)) == len(expected)


# ---- What has two coordinates, and what is stated -------------------------------------------------------------------


TILTED = Placement(OBLIQUE[:, [0, 1, 3]], crs=LPS)


@pytest.mark.parametrize("normal", ["x", "y", "z", "tilted"])
def test_planes_keep_distances_where_there_are_two_coordinates(normal: str) -> None:
    """Planes at right angles to an axis keep the other two coordinates."""
    kept = [axis for axis, name in enumerate("xyz") if name != normal]
    at = TILTED.matrix if normal == "tilted" else np.insert(LINES[kept][:, [*kept, 3]], "xyz".index(normal), [0, 0, 7],
                                                            axis=0)
    assert at is not None
    placement = Placement(at)
    contour = isocodec.decode(isocodec.encode(isocodec.Field(blob((6, 7, 1))[:, :, 0], placement=placement), LEVEL))
    placed, within = contour.placed, contour.flat
    flat = within.placed
    assert placed.shape == (len(contour.points), 3) and flat.shape == (len(contour.points), 2)
    assert within.flat is within and placement.in_space and not placement.flat.in_space
    apart = [np.linalg.norm(points[:, None] - points[None], axis=-1) for points in (placed, flat)]
    assert np.allclose(*apart, rtol=0, atol=1e-12)
    assert np.allclose(placement.lifted(flat), placed, rtol=0, atol=1e-12)
    if normal != "tilted":
        assert np.array_equal(flat, placed[:, kept])
    area = contour.areas()
    corners = np.concatenate([np.array(ring) for part in area["coordinates"] for ring in part])
    assert corners.shape[1] == 3 and np.linalg.norm(corners[:, None] - placed, axis=-1).min(axis=0).max() < 1e-9
    assert np.allclose((corners - at[:, 2]) @ np.cross(at[:, 0], at[:, 1]), 0, atol=1e-9)
    assert np.allclose(np.linalg.norm(contour.normals, axis=1), 1)
    # towards lower values, and within the plane
    assert np.allclose(contour.normals @ np.cross(at[:, 0], at[:, 1]), 0, atol=1e-12)
    inside = placement.place(np.argwhere(blob((6, 7, 1))[:, :, 0] > LEVEL).astype(float)).mean(axis=0)
    assert ((placed - inside) * contour.normals).sum() > 0


def test_planes_in_space_are_given_as_placements() -> None:
    values, whole = blob((6, 7, 1))[:, :, 0], np.array([[0.5, 0, 1], [0, 2, 3], [0, 0, 1]])
    assert isocodec.Field(values, placement=whole).placement.matrix.shape == (2, 3)
    assert isocodec.Field(values, placement=Placement(whole)).placement.in_space
    with pytest.raises(OptionError, match="plane in space"):
        isocodec.Field(values, placement=OBLIQUE[:, [0, 1, 3]])
    for wrong in (whole[:, [0, 0, 2]], whole * [1, 0, 1]):
        with pytest.raises(OptionError, match="one point"):
            isocodec.Field(values, placement=Placement(wrong))
    with pytest.raises(OptionError, match="no periodic axes"):
        isocodec.encode(isocodec.Field(values, placement=Placement(whole, periodic=0)), LEVEL)


def test_planes_in_space_in_other_formats(tmp_path: Path) -> None:
    """Lines and areas of geographic formats have heights, drawings lie in space, meshes face one side."""
    values = blob((6, 7, 1))[:, :, 0]
    file = isocodec.open(isocodec.encode(isocodec.Field(values, placement=TILTED), LEVEL))
    contour = file.contour()
    isocodec.save(tmp_path / "a.gpkg", contour)
    found = geopandas.read_file(tmp_path / "a.gpkg").geometry.get_coordinates(include_z=True).to_numpy()
    assert farthest(found, contour.placed) < 1e-9
    isocodec.save(tmp_path / "a.dxf", contour)
    assert b"POLYLINE" in (tmp_path / "a.dxf").read_bytes()
    assert farthest(np.asarray(contour.to_pyvista().points), contour.placed) < 1e-6
    assert contour.to_pyvista().field_data["SPACE"][0] == "LPS"
    assert {*"xyz"} <= {*contour.to_xarray().coords}
    mesh = file.mesh(whole=True)
    write(tmp_path / "a.ply", mesh)
    surface = trimesh.load(tmp_path / "a.ply", process=False)
    assert stated((tmp_path / "a.ply").read_bytes()) == "LPS"
    assert np.allclose(surface.vertices, TILTED.place(mesh.points.astype(float)), atol=1e-6)
    normal = np.cross(OBLIQUE[:, 0], OBLIQUE[:, 1])
    assert np.allclose(surface.face_normals, normal / np.linalg.norm(normal) * np.sign(normal[abs(normal).argmax()]))
    assert len(contour._repr_png_() or b"") > 1000


def test_windows_of_planes_in_space() -> None:
    file = isocodec.open(isocodec.encode(isocodec.Field(blob((6, 7, 1))[:, :, 0], placement=TILTED), LEVEL))
    cut = isocodec.open(file.edited(window=((2, 5), (2, 6))))
    inside = file.placement.place(np.array([[2.0, 2], [5, 6]]))
    assert cut.placement.in_space and np.allclose(cut.placement.place(np.array([[0.0, 0], [3, 4]])), inside)


def test_left_posterior_superior(tmp_path: Path) -> None:
    """Coordinates that a user gives so stay so, but where the format has others."""
    at, values = np.column_stack([STEPS, START]), blob(SHAPE)
    np.savez(tmp_path / "a.npz", values=values, placement=at, crs=LPS)
    file = isocodec.open(isocodec.encode(isocodec.read(tmp_path / "a.npz"), LEVEL))
    assert file.placement.space == "LPS" and file.crs == LPS
    isocodec.save(tmp_path / "a.ply", file.contour())
    points, body = of_trimesh(tmp_path / "a.ply")
    assert body == "LPS" and np.allclose(points, file.contour().placed, atol=1e-4)
    for suffix, read in MASKS.items():
        write(tmp_path / f"a{suffix}", SampleMask(values > LEVEL, file.placement))
        found, body = read(tmp_path / f"a{suffix}")
        expected = file.placement.place(np.argwhere(values > LEVEL).astype(float))
        assert farthest(found, expected * (FLIP if body == "RAS" else 1)) < 1e-4


def test_masks_without_a_place(tmp_path: Path) -> None:
    """They come back without one."""
    for values in (blob(SHAPE), blob((6, 7, 1))[:, :, 0]):
        write(tmp_path / "a.nrrd", SampleMask(values > LEVEL))
        back = isocodec.read(tmp_path / "a.nrrd")
        assert back.placement is None and np.array_equal(back.values, values > LEVEL)


def test_on_the_command_line(tmp_path: Path) -> None:
    """A plane of NIfTI: its mask and its curve lie in one place."""
    made = nifti(tmp_path, *GEOMETRIES["plane in space"][:1], blob((6, 7, 1)))
    ok("encode", made.thing, "-o", tmp_path / "a.iso", "--isovalue", LEVEL, "--precision", "exact")
    assert "right-anterior-superior" in ok("info", tmp_path / "a.iso")
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.vtp")
    ok("decode", tmp_path / "a.iso", "-o", tmp_path / "a.nrrd", "--what", "above")
    assert farthest(of_vtp(tmp_path / "a.vtp")[0], crossings(made, blob((6, 7, 1)))) < 1e-4
    assert farthest(of_nrrd(tmp_path / "a.nrrd")[0] * FLIP, made.places[blob((6, 7, 1)) > LEVEL]) < 1e-4
