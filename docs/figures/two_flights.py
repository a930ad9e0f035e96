"""Pictures of the page "Two flights" from its folders: `python docs/figures/two_flights.py CHANGE CLOUD_CHANGE`."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image
from start import save


def main(change: Path, clouds: Path) -> None:
    """The map of the change of surfaces, map and histogram of the change of clouds."""
    save(Image.open(change / "plots" / "difference.png"), "two_flights_change")
    save(Image.open(clouds / "plots" / "distances.png"), "two_flights_clouds")
    save(Image.open(clouds / "plots" / "histogram.png"), "two_flights_histogram")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
