"""Plugin for QGIS 3.22 or later: files open by drag and drop, and "Contours to .iso" is in the processing toolbox."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

BUNDLE = Path(__file__).parent / "bundle"
if BUNDLE.is_dir():
    sys.path.append(str(BUNDLE))

from osgeo import gdal  # noqa: E402
from qgis.core import (  # noqa: E402
    QgsApplication,
    QgsProcessingAlgorithm,
    QgsProcessingException,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterRasterLayer,
    QgsProcessingParameterString,
    QgsProcessingProvider,
)


class ToIso(QgsProcessingAlgorithm):
    """Contours of a raster to an .iso file."""

    def createInstance(self) -> ToIso:
        return ToIso()

    def name(self) -> str:
        return "toiso"

    def displayName(self) -> str:
        return "Contours to .iso"

    def shortHelpString(self) -> str:
        return ("Contours of the first band: at isovalues, as 100,250, or at every 50 from 0 to 3000, as 0:3000:50. "
                "Drag the file onto the map to see it.")

    def initAlgorithm(self, config: Any = None) -> None:
        self.addParameter(QgsProcessingParameterRasterLayer("INPUT", "Elevation model"))
        self.addParameter(QgsProcessingParameterString("ISOVALUES", "Isovalues: 100,250 or 0:3000:50", "0:3000:50"))
        self.addParameter(QgsProcessingParameterString("PRECISION", "Precision, such as 5m", "", optional=True))
        self.addParameter(QgsProcessingParameterFileDestination("OUTPUT", "Contours", "Isocontours (*.iso)"))

    def processAlgorithm(self, parameters: dict[str, Any], context: Any, feedback: Any) -> dict[str, str]:
        import numpy as np

        import isocodec
        from isocodec.verbs import values_of

        layer = self.parameterAsRasterLayer(parameters, "INPUT", context)
        out = self.parameterAsFileOutput(parameters, "OUTPUT", context)
        data = gdal.Open(layer.source())
        band, (x, xi, xj, y, yi, yj) = data.GetRasterBand(1), data.GetGeoTransform()
        values, hole = band.ReadAsArray(), band.GetNoDataValue()
        # samples lie at the centres of pixels
        matrix = [[xj, xi, x + (xi + xj) / 2], [yj, yi, y + (yi + yj) / 2]]
        mask = None if hole is None else (np.isnan(values) if hole != hole else values == hole)
        field = isocodec.Field(values, mask, placement=matrix, crs=layer.crs().authid() or None)
        try:
            isovalues = values_of(self.parameterAsString(parameters, "ISOVALUES", context))
            isocodec.save(out, field, isovalues,
                          precision=self.parameterAsString(parameters, "PRECISION", context) or None)
        except (isocodec.IsoError, OSError) as error:
            raise QgsProcessingException(str(error)) from error
        return {"OUTPUT": out}


class Provider(QgsProcessingProvider):
    """The group of the toolbox."""

    def id(self) -> str:
        return "isocodec"

    def name(self) -> str:
        return "Isocontours"

    def loadAlgorithms(self) -> None:
        self.addAlgorithm(ToIso())


class Plugin:
    """Switched on and off by the manager of plugins."""

    def initProcessing(self) -> None:
        self.provider = Provider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:
        import isocodec.plugins

        gdal.SetConfigOption("GDAL_PYTHON_DRIVER_PATH", str(Path(isocodec.plugins.__file__).parent))
        gdal.AllRegister()
        self.initProcessing()

    def unload(self) -> None:
        QgsApplication.processingRegistry().removeProvider(self.provider)


def classFactory(iface: Any) -> Plugin:
    return Plugin()
