"""Programs that open ``.iso`` files: where they are, and what a script that is run in one of them writes."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from home import ROOT
from isocodec.cli import main

SCRIPTS = Path(__file__).parent / "scripts"
PLUGINS = ROOT / "codec/isocodec/plugins"
NAPARI = ROOT / ".venv-apps/bin/python"
DEBIAN = {"ogr2ogr": "gdal-bin", "ogrinfo": "gdal-bin", "qgis": "python3-qgis", "pvpython": "paraview",
          "blender": "blender", "xvfb-run": "xvfb"}
"""Packages of programs."""
SYSTEM = "/usr/bin:/bin"
"""Debian's programs load Debian's Python, which may not be the first on the path."""
SCREEN = ("xvfb-run", "-a", "-w", "5", "-s", "-screen 0 1024x768x24 +extension GLX +render -noreset")


def program(name: str) -> str:
    """Path of a program of Debian; the test fails if it is not installed."""
    path = shutil.which(name, path=SYSTEM)
    if path is None:
        pytest.fail(f"{name} is not installed: run make apps, or apt-get install {DEBIAN[name]}")
    return path


def installed(home: Path) -> tuple[Path, Path]:
    """What `isocodec plugins --qgis` puts into a home folder: QGIS's folder of plugins, and isocodec beside ours."""
    done = CliRunner().invoke(main, ["plugins", "--qgis", "--json"], env={"XDG_DATA_HOME": str(home)})
    plugin = Path(json.loads(done.output)["qgis"])
    return plugin.parent, plugin / "bundle"


def command(name: str, script: str) -> list[str]:
    """How a script is run in a program."""
    path = str(SCRIPTS / script)
    if name == "paraview":
        return [program(SCREEN[0]), *SCREEN[1:], program("pvpython"), path]
    if name == "blender":
        return [program("blender"), "--background", "--python-exit-code", "1", "--python", path, "--"]
    if name == "napari":
        if not NAPARI.exists():
            pytest.fail("napari is not installed: run make apps")
        return [program(SCREEN[0]), *SCREEN[1:], str(NAPARI), path]
    if name == "qgis":
        program("qgis")
        return ["/usr/bin/python3", path]
    return [sys.executable, path]


def run(words: list[str], bundle: Path, **more: str) -> str:
    """Run a program with isocodec on its path, without a screen; returns what it prints."""
    own = words[0] == sys.executable
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=600, env={
        "HOME": os.environ["HOME"], "PATH": os.environ["PATH"] if own else SYSTEM, "PYTHONPATH": str(bundle),
        "QT_QPA_PLATFORM": "xcb" if words[0].endswith(SCREEN[0]) else "offscreen",
        "GDAL_PYTHON_DRIVER_PATH": str(PLUGINS), **more,
    })
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def found(name: str, script: str, asked: dict[str, Any], bundle: Path, folder: Path, **more: str) -> dict[str, Any]:
    """What a script writes into an ``.npz`` file, by name."""
    out = folder / f"{name}.npz"
    run([*command(name, script), json.dumps({**asked, "out": str(out)})], bundle, **more)
    with np.load(out) as arrays:
        return {**arrays}
