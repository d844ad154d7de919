"""What a type checker finds in a user's script: all that is wrong, and nothing that is right."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.heavy

pytest.importorskip("mypy")

RIGHT = '''
from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import isocodec
from isocodec import Contour, Field, Frames, IsoError, IsoFile, Limits, Mesh, Tin
from isocodec.stream.options import EncodeOptions

field = np.hypot(*np.mgrid[:64, :64])
options: EncodeOptions = {"precision": 0.5, "profile": "baseline", "metadata": {"unit": "m"}}
data: bytes = isocodec.encode(field, 20.0, **options)
data = isocodec.encode(field, [20, Fraction(61, 2), np.float32(40)], precision=[4, 1, "exact"], layers=None)
data = isocodec.encode(Field(field, placement=[-30, 30], crs="EPSG:4326"), np.linspace(5, 50, 4), progress=print)
data = isocodec.encode(field > 3)
data = isocodec.encode(isocodec.read("a.tif", key="z"), 3, precision="100m", layers="base")
data = isocodec.encode(field, "every 20 from 5", precision="step=0.5", layers="distortion=1.0")
data = isocodec.encode(field, [3, 5], layers={3.0: [("base", 2)], 5.0: [("base", None), ("refine", 3)]})
frames = isocodec.encode(Frames([field, field]), 3.0, interval=2, precision="signs")
series = isocodec.Encoder(3.0, interval=2, profile="main")
data = series.add(field) + series.finish()
contour: Contour = isocodec.decode(data, isovalue=20.0, limits=Limits(memory=1 << 28), smooth=True)
points: NDArray[np.float64] = contour.placed
lengths = [float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in contour.lines]
file: IsoFile = isocodec.open(Path("a.iso"))
for one in file.contours(frame=1, layers=2):
    print(one.isovalue, one.placement, one.metadata.get("crs"), file.crs)
isocodec.save("a.gpkg", file.contours())
isocodec.save("b.iso", field, 3.0, precision="exact", profile="main", tile=1024)
mesh = isocodec.encode(Mesh(np.eye(3)[:, :2], [[0, 1, 2]], [0.0, 1.0, 2.0], stored="coded", error=0.01), 0.5)
thinned: Tin = isocodec.thin(field, criterion="l2", to=100)
above: NDArray[np.bool_] = isocodec.open(data).above(20.0, frame=0)
decoder = isocodec.Decoder()
decoder.feed(isocodec.open(data).edited(profile="baseline", precision=1.0))
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
isocodec.encode(field, 1.0, layers=2.5)  # layers
isocodec.encode(field, 1.0, precision=[4, None])  # None
isocodec.encode(field, {1.0: 2})  # Argument 2
isocodec.encode(field, 1.0, keep_topology="yes")  # keep_topology
isocodec.encode(field, 1.0, metadata={"step": 3})  # entry
isocodec.encode(isocodec.Frames([field]), 1.0, profil="main")  # profil
isocodec.Encoder(1.0, precison="exact")  # precison
isocodec.encode(isocodec.Field(field, label=[1]))  # label
isocodec.save("a.iso", field, 1.0, tile="32")  # tile
isocodec.Mesh(np.zeros((3, 2)), None, np.zeros(3), stored="coder")  # stored
isocodec.save("a.iso", field, 1.0, exakt=True)  # exakt
isocodec.save("a.iso", field, 1.0, precision=[b"fine"])  # bytes
isocodec.open("a.iso", limit=3)  # limit
isocodec.decode(data, layer=3)  # layer
isocodec.open(data).edited(layer=2)  # layer
isocodec.open(data).verify(field, within=[3])  # within
isocodec.encod(field, 1.0)  # encod
contour.point  # point
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
