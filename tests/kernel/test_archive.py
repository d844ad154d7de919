"""The package in an archive on the path, as programs that embed Python carry it."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import isocodec
import isospec

PROGRAM = """
import sys
import isocodec, numpy as np
y, x = np.mgrid[:24, :30]
data = isocodec.encode(np.hypot(y - 12, x - 14), 8.0)
print(isocodec.kernels(), len(data), len(isocodec.decode(data).points), isocodec.__file__)
"""


def test_a_round_trip_out_of_an_archive(tmp_path):
    archive = tmp_path / "packed.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        for home in (Path(isocodec.__file__).parent, Path(isospec.__file__).parent):
            for path in home.rglob("*"):
                if path.is_file() and "__pycache__" not in path.parts:
                    packed.write(path, path.relative_to(home.parent))
    found = []
    for place in (archive, os.pathsep.join(sys.path)):
        done = subprocess.run([sys.executable, "-c", PROGRAM], env={**os.environ, "PYTHONPATH": str(place)},
                              capture_output=True, text=True, cwd=tmp_path, check=False)
        assert done.returncode == 0, done.stderr
        found.append(done.stdout.split())
    assert str(archive) in found[0][-1] and str(archive) not in found[1][-1]
    assert found[0][:-1] == found[1][:-1]
    assert [*tmp_path.iterdir()] == [archive]
