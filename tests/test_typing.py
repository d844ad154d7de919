"""What a type checker finds in a user's script: all that is wrong, and nothing that is right."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy")

RIGHT = '''
from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import isocodec
from isocodec import Contour, EncodeOptions, IsoError, IsoFile, Limits

field = np.hypot(*np.mgrid[:64, :64])
options: EncodeOptions = {"tolerance": 0.5, "profile": "baseline", "metadata": {"unit": "m"}}
data: bytes = isocodec.encode(field, 20.0, **options)
data = isocodec.encode(field, [20, Fraction(61, 2), np.float32(40)], steps=[4, 1, "exact"], criterion=None)
data = isocodec.encode(field, np.linspace(5, 50, 4), placement=[-30, 30], periodic=1, progress=print)
data = isocodec.encode(field > 3)
data = isocodec.encode(isocodec.read("a.tif", key="z"), 3, tolerance="100m", plan=isocodec.read_plan("base"))
frames = isocodec.encode_frames([field, field], 3.0, interval=2, signs_only=True)
contour: Contour = isocodec.decode(data, isovalue=20.0, limits=Limits(memory=1 << 28))
points: NDArray[np.float64] = contour.placed
lengths = [float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in contour.lines]
for one in isocodec.decode_all(Path("a.iso")):
    print(one.isovalue, one.crs if isinstance(one, IsoFile) else one.metadata.get("crs"))
file = isocodec.open("a.iso")
if isinstance(file, IsoFile):
    isocodec.save("a.gpkg", file.contours())
isocodec.save("b.iso", field, 3.0, exact=True, profile="main")
mesh = isocodec.encode_mesh(np.eye(3)[:, :2], [[0, 1, 2]], [0.0, 1.0, 2.0], 0.5, mesh="coded", mesh_error=0.01)
thinned = isocodec.thin(field, None, "l2", to=100).tin()
decoder = isocodec.Decoder()
decoder.feed(isocodec.transcode(data, profile="baseline", tolerance=1.0))
try:
    decoder.close()
except IsoError as error:
    print(error.message, error.code, error.remedy)
'''

WRONG = '''
import numpy as np
import isocodec
field = np.zeros((4, 4))
data = b""
contour = isocodec.decode(data)
isocodec.encode(field, 1.0, profile="mian")  # profile
isocodec.encode(field, 1.0, criterion="topologie")  # criterion
isocodec.encode(field, 1.0, steps=[4, "exakt"])  # exakt
isocodec.encode(field, 1.0, tolerence=1)  # tolerence
isocodec.encode(field, "1.0")  # Argument 2
isocodec.encode(field, 1.0, exact="yes")  # exact
isocodec.encode(field, 1.0, metadata={"step": 3})  # entry
isocodec.encode_frames([field], 1.0, profil="main")  # profil
isocodec.encode_frames([field], 1.0, profile="best")  # profile
isocodec.SeriesEncoder(1.0, exat=True)  # exat
isocodec.Encoder(field, 1.0, profile="best")  # profile
isocodec.encode_labels(field, [1], profile="best")  # profile
isocodec.encode_tiles(field, 1.0, "a.iso", profile="best")  # profile
isocodec.encode_mesh(np.zeros((3, 2)), None, np.zeros(3), 1.0, mesh="coder")  # mesh
isocodec.thin(field, None, "AT9")  # Argument 3
isocodec.transcode(data, profile="best")  # profile
isocodec.merge([data], profile=1)  # profile
isocodec.save("a.iso", field, 1.0, exakt=True)  # exakt
isocodec.save("a.iso", field, 1.0, profile="best")  # profile
isocodec.save("a.iso", field, 1.0, steps=["fine"])  # fine
isocodec.open("a.iso", limit=3)  # limit
isocodec.open("a.iso", limits=3)  # limits
isocodec.decode(data, layer=3)  # layer
isocodec.decode(data, layers="all")  # layers
isocodec.decode(data, smooth=2.5)  # smooth
truncate(data, layer=2)  # layer
isocodec.verify(data, field, tolerance="a", within=3)  # verify
contour.areas(abov=True)  # abov
isocodec.encod(field, 1.0)  # encod
isocodec.Limits(memori=3)  # memori
contour.point  # point
contour.to_geodataframe(crs=3)  # crs
isocodec.EncodeOptions(exakt=True)  # exakt
'''


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[int, str]]:
    """What mypy says of each line of both scripts, as users run it: strict, with no configuration of ours."""
    folder = tmp_path_factory.mktemp("typing")
    for name, text in (("right", RIGHT), ("wrong", WRONG)):
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--show-error-codes", "--no-error-summary",
               "--cache-dir", str(folder / "cache"), "right.py", "wrong.py"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=600)
    assert done.returncode in (0, 1), done.stderr
    out: dict[str, dict[int, str]] = {"right.py": {}, "wrong.py": {}}
    for name, line, text in re.findall(r"^([^:\n]+):([0-9]+): error: (.*)$", done.stdout, re.MULTILINE):
        out[Path(name).name][int(line)] = text
    return out


def test_nothing_right_is_found_wrong(found: dict[str, dict[int, str]]) -> None:
    assert found["right.py"] == {}


def test_each_wrong_line_is_found(found: dict[str, dict[int, str]]) -> None:
    """And it is the fault that is named."""
    lines = {i: line.partition("  # ")[2] for i, line in enumerate(WRONG.splitlines(), 1) if "  # " in line}
    assert {*found["wrong.py"]} == {*lines}
    for number, word in lines.items():
        assert word in found["wrong.py"][number], found["wrong.py"][number]


def test_the_package_says_that_it_is_typed() -> None:
    import isocodec

    assert (Path(isocodec.__file__).parent / "py.typed").is_file()
