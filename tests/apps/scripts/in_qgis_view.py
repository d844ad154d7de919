"""Seconds of the clock and of the processor from adding a layer to its first lines on a map of QGIS, and to all."""

import json
import os
import sys
import time

from qgis.core import QgsApplication, QgsMapRendererParallelJob, QgsMapSettings, QgsVectorLayer
from qgis.PyQt.QtCore import QEventLoop, QSize, QTimer
from qgis.PyQt.QtGui import QColor

asked = json.loads(sys.argv[-1])
sys.path.insert(0, asked["plugins"])
program = QgsApplication([], True)
program.initQgis()
import isocontours  # noqa: E402

isocontours.classFactory(None).initGui()
seconds: dict[str, list[float]] = {}
started = time.time(), time.process_time()


def reached(name):
    job.renderedImage().save(f"{asked['pictures']}-{name}.png")
    seconds[name] = [time.time() - started[0], time.process_time() - started[1]]


def look():
    image = job.renderedImage()
    if "first" not in seconds and image.constBits().asstring(image.sizeInBytes()).strip(b"\xff"):
        reached("first")


layer = QgsVectorLayer(f"{asked['path']}|layername=overview", "overview", "ogr")
assert layer.isValid()
settings = QgsMapSettings()
settings.setLayers([layer])
settings.setDestinationCrs(layer.crs())
settings.setExtent(layer.extent())
settings.setOutputSize(QSize(1000, 1000))
settings.setBackgroundColor(QColor("white"))
job, loop, timer = QgsMapRendererParallelJob(settings), QEventLoop(), QTimer()
timer.timeout.connect(look)
timer.start(50)
job.finished.connect(loop.quit)
job.start()
loop.exec_()
look()
reached("all")
print(json.dumps(seconds))
sys.stdout.flush()
os._exit(0)
