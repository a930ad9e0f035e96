"""Draws every layer of result.gpkg as QGIS does: its own library, with the styles that the file brings along.

Needs QGIS (Debian: `apt-get install python3-qgis qgis-providers`) and the Python that it was installed for, not the
virtual environment of aerotri. No window is opened.

    QT_QPA_PLATFORM=offscreen /usr/bin/python3 tools/qgis_map.py result.gpkg map.png
"""

from __future__ import annotations

import argparse
import sqlite3
import sys
from pathlib import Path

from qgis.core import (  # pyright: ignore[reportMissingImports]
    QgsApplication,
    QgsMapRendererParallelJob,
    QgsMapSettings,
    QgsRectangle,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QSize  # pyright: ignore[reportMissingImports]
from qgis.PyQt.QtGui import QColor  # pyright: ignore[reportMissingImports]

DPI, MARGIN = 120, 0.04


def layer_names(path: Path) -> list[str]:
    """Feature tables in the order of the file."""
    with sqlite3.connect(path) as base:
        rows = base.execute("SELECT table_name FROM gpkg_contents WHERE data_type = 'features' ORDER BY rowid")
        return [name for (name,) in rows]


def opened(path: Path, names: list[str]) -> list[QgsVectorLayer]:
    """The layers with the style that the file has for each."""
    layers = []
    for name in names:
        layer = QgsVectorLayer(f"{path}|layername={name}", name, "ogr")
        if not layer.isValid():
            sys.exit(f"{path}: QGIS cannot open the layer {name}")
        said, of_file = layer.loadDefaultStyle()
        if not of_file:
            sys.exit(f"{path}: the style of {name} is not taken: {said}")
        symbols = layer.renderer().legendSymbolItems()
        print(f"{name}: {layer.featureCount()} features, {layer.renderer().type()} with {len(symbols)} symbols")
        layers.append(layer)
    return layers


def draw(layers: list[QgsVectorLayer], target: Path, width: int) -> None:
    """A map of all layers, the first of the file lowest."""
    area = QgsRectangle()
    for layer in layers:
        if layer.featureCount():
            area.combineExtentWith(layer.extent())
    area.grow(MARGIN * max(area.width(), area.height()))
    settings = QgsMapSettings()
    settings.setLayers(layers[::-1])
    settings.setDestinationCrs(layers[0].crs())
    settings.setExtent(area)
    settings.setOutputDpi(DPI)
    settings.setOutputSize(QSize(width, round(width * area.height() / area.width())))
    settings.setBackgroundColor(QColor("white"))
    job = QgsMapRendererParallelJob(settings)
    job.start()
    job.waitForFinished()
    for error in job.errors():
        sys.exit(f"{error.layerID}: {error.message}")
    if not job.renderedImage().save(str(target)):
        sys.exit(f"{target}: cannot be written")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--layer", action="append", help="one layer alone; may be repeated")
    parser.add_argument("--width", type=int, default=1400)
    given = parser.parse_args()
    program = QgsApplication([], False)
    program.initQgis()
    draw(opened(given.file, given.layer or layer_names(given.file)), given.picture, given.width)
    program.exitQgis()


if __name__ == "__main__":
    main()
