"""``isocodec plugins``: where the plugins for other programs lie, and isocodec as one file or folder for them."""

from __future__ import annotations

import io
import os
import sys
import zipfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from shutil import rmtree

import click

from ..errors import OptionError
from ..verbs import Plugins
from .parameters import Call, command
from .report import concerning, write_output

FOLDER = Path(__file__).parent.parent / "plugins"
PLUGINS = {
    "GDAL": ("gdal_iso.py", "set GDAL_PYTHON_DRIVER_PATH to the folder of this file"),
    "QGIS": ("qgis", "isocodec plugins --qgis; then switch Isocontours on in the manager of plugins"),
    "ParaView": ("paraview_iso.py", "Tools, Manage Plugins, Load New; isocodec has to be in PYTHONPATH"),
    "napari": ("napari.yaml", "pip install isocodec beside napari is all"),
    "Blender": ("blender_iso.py", "Edit, Preferences, Add-ons, Install; isocodec has to be in PYTHONPATH"),
    "3D Slicer": ("slicer_iso.py", "Edit, Application Settings, Modules: add the folder of this file"),
}
"""The file of each program, and how to switch it on."""
PROFILES = {"win32": "AppData/Roaming", "darwin": "Library/Application Support"}
"""Folders below the home folder in which programs keep what users set; elsewhere ``.local/share``."""


def _contents() -> Iterator[tuple[Path, str]]:
    """Yield the files of isocodec and of what decoding needs beside numpy, with their names in a bundle."""
    for package in ("isocodec", "isospec", "construct"):
        spec = find_spec(package)
        assert spec is not None and spec.submodule_search_locations
        home = Path(spec.submodule_search_locations[0])
        for path in sorted(home.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                yield path, f"{package}/{path.relative_to(home).as_posix()}"


def _to_qgis() -> Path:
    """Put the plugin and what it needs into the default profile of QGIS; returns its folder."""
    base = Path(os.environ.get("XDG_DATA_HOME") or Path.home() / PROFILES.get(sys.platform, ".local/share"))
    home = base / "QGIS/QGIS3/profiles/default/python/plugins/isocontours"
    rmtree(home, ignore_errors=True)  # files of another version must not stay
    for path, name in [*((path, path.name) for path in sorted((FOLDER / "qgis").iterdir()) if path.is_file()),
                       *((path, f"bundle/{name}") for path, name in _contents())]:
        (home / name).parent.mkdir(parents=True, exist_ok=True)
        (home / name).write_bytes(path.read_bytes())
    return home


@command("plugins", Plugins, "Open .iso files in other programs.")
def plugins_command(call: Call, options: Plugins) -> None:
    """Show where the plugins for other programs lie, and how to switch them on.

    With --bundle, write isocodec as one file of 2 MB: programs that have Python 3.10 and numpy 1.24, or later versions,
    decode with it once it is in PYTHONPATH, faster when it is unpacked.
    """
    facts = {program: str(FOLDER / name) for program, (name, _) in PLUGINS.items()}
    if options.bundle is not None:
        if options.bundle.suffix != ".zip":
            raise OptionError(f"{options.bundle} does not end in .zip", code="output")
        whole = io.BytesIO()
        with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
            for path, name in _contents():
                archive.write(path, name)
        write_output(options.bundle, whole.getvalue())
        facts["bundle"] = str(options.bundle)
    if options.qgis:
        with concerning("QGIS"):
            facts["qgis"] = str(_to_qgis())
    if call.as_json:
        import json

        click.echo(json.dumps(facts))
        return
    for program, (name, how) in PLUGINS.items():
        click.echo(f"{program:10}  {FOLDER / name}\n{'':10}  {how}")
    for made in ("bundle", "qgis"):
        if made in facts:
            click.echo(f"written: {facts[made]}")
