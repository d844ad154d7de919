"""Curves as the reference decodes them: a line of JSON for each line of JSON with a file and a window of it."""

import json
import sys

import isocodec

for line in sys.stdin:
    asked = json.loads(line)
    if "window" in asked:
        file = isocodec.open(asked["file"])
        options = dict(asked["options"])
        isovalue = file.isovalues[options.pop("isovalue", 0)]
        if "layer" in options:
            options["layers"] = options.pop("layer") + 1
        contour = file.contour(isovalue, window=asked["window"], **options)
    else:
        contour = isocodec.decode(asked["file"])
    print(json.dumps({"points": contour.points.tolist(), "cells": contour.cells.tolist()}), flush=True)
