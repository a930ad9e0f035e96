"""What a volume makes of outlines, units, height systems and σ that are stated: taken as meant, told, or refused."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import shapely.affinity

import aerotri

LEFT, TOP, CELL, COUNT = 500000.0, 5600100.0, 0.5, 200
RADIUS, HEIGHT = 12.0, 5.0
CONE = np.pi * RADIUS**2 * HEIGHT / 3.0
MIDDLE = (LEFT + 30.0, TOP - 50.0)
CRS = "EPSG:25832"


def heights(with_cone=True):
    """A cone on a plane that slopes by 2 %, (rows, columns) m."""
    at = (np.arange(COUNT) + 0.5) * CELL
    x, y = np.meshgrid(LEFT + at, TOP - at)
    ground = 100.0 + 0.02 * (x - LEFT) + 0.01 * (y - TOP)
    cone = np.maximum(HEIGHT * (1.0 - np.hypot(x - MIDDLE[0], y - MIDDLE[1]) / RADIUS), 0.0)
    return ground + cone if with_cone else ground


def surface(z, crs=CRS, name="cone"):
    return aerotri.Surface.of_array(z, left=LEFT, top=TOP, cell=CELL, crs=crs, name=name)


@pytest.fixture(scope="module")
def cone():
    return surface(heights())


@pytest.fixture(scope="module")
def ground():
    return surface(heights(with_cone=False), name="ground")


AROUND = shapely.Point(MIDDLE).buffer(14.0, quad_segs=64)


@pytest.mark.parametrize("hole", [
    shapely.box(MIDDLE[0] - 1.0, MIDDLE[1] - 1.0, MIDDLE[0] + 1.0, MIDDLE[1] + 1.0),
    shapely.box(MIDDLE[0] + 3.0, MIDDLE[1], MIDDLE[0] + 6.0, MIDDLE[1] + 3.0),
])  # fmt: skip
@pytest.mark.parametrize("base", ["boundary", "plane"])
def test_a_hole_on_the_pile_does_not_lift_the_base(cone, ground, hole, base):
    outline = AROUND.difference(hole)
    true = aerotri.volume(cone, outline, base=ground)
    found = aerotri.volume(cone, outline, base=base)
    assert found.net == pytest.approx(true.net, rel=0.002)
    assert any("1 hole:" in text for text in found.warnings)
    assert not any("hole" in text for text in true.warnings)


def test_outlines_that_share_a_line_are_told(cone):
    west, east = (shapely.intersection(AROUND, shapely.box(*box)) for box in (
        (LEFT, TOP - 100.0, MIDDLE[0], TOP), (MIDDLE[0], TOP - 100.0, LEFT + 100.0, TOP),
    ))  # fmt: skip
    piles = {"west": west, "east": east}
    shared = "the outlines of west and east share 28.1 m"
    assert any(shared in text for text in aerotri.volume(cone, piles).warnings)
    over = aerotri.volume(cone, piles, base="plane:500000,5600100,100;500100,5600100,102;500000,5600000,99")
    assert not any("share" in text for text in over.warnings)
    assert over.net == pytest.approx(CONE, rel=0.005)
    apart = {"west": west, "east": shapely.affinity.translate(east, 3.0)}
    assert not any("share" in text for text in aerotri.volume(cone, apart).warnings)
