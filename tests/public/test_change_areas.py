"""Areas of a change that the surfaces know in part, or not at all."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import aerotri
from aerotri import InputError

SIDE = 60


def flat(height, name, hole=None):
    z = np.full((SIDE, SIDE), height)
    if hole is not None:
        z[hole] = np.nan
    return aerotri.Surface.of_array(
        z, left=0.0, top=SIDE, cell=1.0, sigma=np.where(np.isfinite(z), 0.02, np.nan), name=name
    )


def test_what_lies_outside_of_the_surfaces_is_area_without_heights():
    found = aerotri.change(flat(1.0, "may"), flat(2.0, "june"), area=shapely.box(40.0, 10.0, 80.0, 30.5))
    (v,) = found.summary["volumes"]
    assert v["area_m2"] == pytest.approx(20.0 * 20.5)
    assert v["no_data_area_m2"] == pytest.approx(20.0 * 20.5)
    assert any("410 m² (50 %) of the area have no height in both surfaces" in text for text in found.warnings)


def test_holes_are_told_of_each_area():
    hole = np.s_[10:20, 10:20]
    areas = {"whole": shapely.box(30, 10, 50, 30), "torn": shapely.box(5, 30, 25, 55)}
    found = aerotri.change(flat(1.0, "may"), flat(2.0, "june", hole), area=areas)
    by = {v["name"]: v for v in found.summary["volumes"]}
    assert by["whole"]["no_data_area_m2"] == 0.0
    assert by["torn"]["no_data_area_m2"] == pytest.approx(100.0)
    assert by["torn"]["area_m2"] + by["torn"]["no_data_area_m2"] == pytest.approx(500.0)
    told = [text for text in found.warnings if "have no height" in text]
    assert [text.partition(":")[0] for text in told] == ["torn"]
    # without areas holes and edges of the surfaces are no news
    assert not any("have no height" in text for text in aerotri.change(flat(1.0, ""), flat(2.0, "", hole)).warnings)


@pytest.mark.parametrize("place", [shapely.box(500, 500, 520, 520), shapely.box(12, 42, 18, 48)])
def test_an_area_of_which_nothing_is_known_is_refused_by_name(place):
    areas = {"near": shapely.box(30, 10, 50, 30), "away": place}
    with pytest.raises(InputError, match="'away': the surfaces may and june have no height"):
        aerotri.change(flat(1.0, "may"), flat(2.0, "june", np.s_[10:20, 10:20]), area=areas)


def test_surfaces_without_a_height_in_common_are_refused():
    with pytest.raises(InputError, match="have no height"):
        aerotri.change(flat(1.0, "may", np.s_[:30]), flat(2.0, "june", np.s_[28:]))
