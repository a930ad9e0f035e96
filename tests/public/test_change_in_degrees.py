"""Change between surfaces that count in degrees: volumes are in cubic metres all the same, or it is refused."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import Transformer

import aerotri
from aerotri import InputError

HEIGHT, SLOPE, SIGMA = 5.0, 0.3, 0.02
CONE = np.pi * (HEIGHT / SLOPE) ** 2 * HEIGHT / 3.0


def heap(x, y):
    return np.maximum(HEIGHT - SLOPE * np.hypot(x, y), 0.0)


def in_degrees(folder, name, middle, dumped, cells=160):
    """A file in degrees around a place (lon, lat) with cells of 0.5 m from north to south; a cone on it or not."""
    lon, lat = middle
    step = 0.5 / 111_200.0
    x = (np.arange(cells) - cells / 2 + 0.5) * step
    local = Transformer.from_crs("EPSG:4326", f"+proj=aeqd +lon_0={lon} +lat_0={lat} +units=m", always_xy=True)
    east, north = local.transform(*np.meshgrid(lon + x, lat - x))
    z = 100.0 + 0.01 * east + (heap(east, north) if dumped else 0.0)
    left, top = lon - cells / 2 * step, lat + cells / 2 * step
    made = aerotri.Surface.of_array(
        z, left=left, top=top, cell=step, crs="EPSG:4326", sigma=np.full(z.shape, SIGMA), name=name
    )
    return made.save(folder / f"{name}.tif")


def in_metres(folder, name, middle, dumped, crs, cells=100):
    """A file in a system in metres, cells of 0.5 m, around the same place."""
    x0, y0 = Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*middle)
    x = 0.5 * (np.arange(cells) - cells / 2 + 0.5)
    east, north = np.meshgrid(x, -x)
    z = 100.0 + 0.01 * east + (heap(east, north) if dumped else 0.0)
    made = aerotri.Surface.of_array(
        z, left=x0 - 0.25 * cells, top=y0 + 0.25 * cells, cell=0.5, crs=crs, sigma=np.full(z.shape, SIGMA), name=name
    )
    return made.save(folder / f"{name}.tif")


def volume(found):
    return found.summary["volumes"][0]


def test_volumes_of_surfaces_in_degrees_are_in_cubic_metres(tmp_path):
    first, second = (in_degrees(tmp_path, name, (8.99, 48.0), name == "after") for name in ("before", "after"))
    found = aerotri.change(first, second, align="none")
    assert found.summary["crs"] == "EPSG:32632"
    assert 0.3 < found.grid.cell_x < 0.6
    assert volume(found)["net_m3"] == pytest.approx(CONE, rel=0.003)
    # σ of a sum of cells that share nothing
    cells = volume(found)["area_m2"] / found.grid.cell_x**2
    assert volume(found)["sigma_net_m3"] == pytest.approx(SIGMA * np.sqrt(2.0 * cells) * found.grid.cell_x**2, rel=0.01)
    assert [note for note in found.warnings if "EPSG:4326 (WGS 84), which counts in degree, to EPSG:32632" in note]
    saved = found.save(tmp_path / "changed")
    assert (saved / "change.html").is_file()


@pytest.mark.parametrize("turned", [False, True])
def test_one_in_degrees_goes_to_the_system_of_the_other(tmp_path, turned):
    middle = (8.99, 48.0)
    given = in_degrees(tmp_path, "degrees", middle, turned), in_metres(
        tmp_path, "metres", middle, not turned, "EPSG:25832"
    )  # fmt: skip
    found = aerotri.change(*(reversed(given) if turned else given), align="none")
    assert found.summary["crs"] == "EPSG:25832"
    assert volume(found)["net_m3"] == pytest.approx(CONE, rel=0.003)


def test_surfaces_on_either_side_of_a_zone_border_go_to_one_zone(tmp_path):
    """The middle of the second is in zone 33, of the first in zone 32; each alone would go to its own."""
    apart = 6.0 / 74_600.0
    first = in_degrees(tmp_path, "before", (12.0 - apart, 48.0), False, 240)
    second = in_degrees(tmp_path, "after", (12.0 + apart, 48.0), True, 240)
    found = aerotri.change(first, second, align="none")
    assert found.summary["crs"] == "EPSG:32632"
    # both fall by 1 % to the west of their own middle
    lower = 0.01 * 2.0 * 6.0 * volume(found)["area_m2"]
    assert volume(found)["net_m3"] == pytest.approx(CONE - lower, rel=0.01)


def test_heights_in_memory_that_count_in_degrees_are_refused():
    """Their cells would be taken for metres."""
    flat = aerotri.Surface.of_array(
        np.full((20, 20), 1.0), left=9.0, top=48.0, cell=1e-5, crs="EPSG:4326", sigma=np.full((20, 20), 0.1)
    )
    for use in (
        lambda: aerotri.change(flat, flat, align="none"), lambda: aerotri.compare(flat, flat),
        lambda: aerotri.volume(flat, base=0.0),
    ):  # fmt: skip
        with pytest.raises(InputError, match="counts in degree") as told:
            use()
        assert "save it as a GeoTIFF" in str(told.value)
