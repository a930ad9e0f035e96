"""Change between two surfaces: a dump of known volume, and ground that did not change."""

from __future__ import annotations

import json

import numpy as np
import pytest
import rasterio
import shapely
from scipy.ndimage import uniform_filter

import aerotri
from aerotri import InputError
from aerotri.commands.change import _summary
from aerotri.formats.results.change import at_most

SIDE, SIGMA, WINDOW = 120, 0.03, 4
STABLE = shapely.difference(shapely.box(0, 0, SIDE, SIDE), shapely.box(30, 30, 90, 90))
AREA = shapely.box(35, 35, 85, 85)
AT = np.arange(SIDE) + 0.5
X, Y = np.meshgrid(AT, AT[::-1])


def ground(x, y):
    return 100.0 + 3.0 * np.sin(x / 15.0) * np.cos(y / 20.0) + 0.02 * x


def dump(x, y):
    return np.maximum(5.0 - 0.3 * np.hypot(x - 60.0, y - 60.0), 0.0)


def surface(z, rng, name="surface"):
    """With noise that is the mean of a square of cells."""
    white = rng.normal(size=(SIDE + 2 * WINDOW, SIDE + 2 * WINDOW))
    noise = SIGMA * WINDOW * uniform_filter(white, WINDOW)[WINDOW:-WINDOW, WINDOW:-WINDOW]
    sigma = np.full((SIDE, SIDE), SIGMA)
    return aerotri.Surface.of_array(z + noise, left=0.0, top=SIDE, cell=1.0, sigma=sigma, name=name)


def epochs(seed, heap=True):
    """The second one shifted, lifted and tilted."""
    rng = np.random.default_rng(seed)
    (tx, ty), up, tilt = rng.normal(0.0, 0.2, 2), rng.normal(0.0, 0.1), rng.normal(0.0, 5e-4, 2)
    z = ground(X - tx, Y - ty) + up + tilt[0] * X + tilt[1] * Y
    if heap:
        z = z + dump(X - tx, Y - ty)
    return surface(ground(X, Y), rng, "may"), surface(z, rng, "june"), (tx, ty)


def test_volume_of_a_dump_scatters_as_stated():
    errors, shifts = [], []
    for seed in range(25):
        first, second, (tx, ty) = epochs(seed)
        found = aerotri.change(first, second, stable=STABLE, align="tilt", area=AREA)
        v = found.summary["volumes"][0]
        errors.append((v["net_m3"] - dump(X, Y).sum()) / v["sigma_net_m3"])
        by = {one["name"]: one for one in found.summary["alignment"]["unknowns"]}
        shifts += [(by[name]["value"] - true) / by[name]["sigma"] for name, true in (("dX", tx), ("dY", ty))]
    # 99.9 % of the root mean square of 25, and of 50, normal errors
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.48
    assert 0.7 < np.sqrt(np.mean(np.square(shifts))) < 1.35


def test_without_change_one_cell_in_twenty_is_beyond_the_level_of_detection():
    share = [
        aerotri.change(*epochs(seed, heap=False)[:2], stable=STABLE, align="tilt").summary["beyond_level_percent"]
        for seed in range(5)
    ]
    assert np.mean(share) == pytest.approx(5.0, abs=1.0)


def test_noise_that_neighbours_share_is_seen_on_stable_ground():
    found = aerotri.change(*epochs(3)[:2], stable=STABLE, align="shift")
    assert found.summary["noise_length_m"] == pytest.approx(WINDOW, rel=0.3)
    # four times the noise that is stated
    halved = [aerotri.Surface.of_array(one.z, left=0.0, top=SIDE, cell=1.0, sigma=one.sigma / 4.0)
              for one in epochs(3)[:2]]  # fmt: skip
    again = aerotri.change(*halved, stable=STABLE, align="shift")
    np.testing.assert_allclose(again.sigma, found.sigma, rtol=0.1)


def test_what_is_gained_and_lost():
    """Without an alignment; a hole and a heap of a metre each, 50 σ."""
    rng = np.random.default_rng(1)
    z = ground(X, Y)
    z[20:30, 20:30] += 1.0
    z[60:80, 60:80] -= 1.0
    area = {"heap": shapely.box(20, 90, 30, 100), "hole": shapely.box(55, 35, 85, 65)}
    before, after = surface(ground(X, Y), rng), surface(z, rng)
    found = aerotri.change(before, after, align="none", noise_length=WINDOW, area=area)
    heap, hole, both = found.summary["volumes"]
    assert heap["gained_m3"] == pytest.approx(100.0, abs=4.0 * heap["sigma_gained_m3"])
    assert hole["lost_m3"] == pytest.approx(400.0, abs=15.0)
    assert both["net_m3"] == pytest.approx(heap["net_m3"] + hole["net_m3"])
    # along either axis the correlations of ten cells, 1 − lag/window, add up to this
    alike = 10.0 + 2.0 * sum((10.0 - lag) * (1.0 - lag / WINDOW) for lag in range(1, WINDOW))
    assert heap["sigma_net_m3"] == pytest.approx(np.sqrt(2.0) * SIGMA * alike, rel=1e-6)


def test_the_folder(tmp_path):
    first, second, _ = epochs(1)
    found = aerotri.change(first.save(tmp_path / "may.tif"), second.save(tmp_path / "june.tif"), stable=STABLE.wkt,
                           area=AREA.wkt)  # fmt: skip
    out = found.save(tmp_path / "change")
    content = json.loads((out / "change.json").read_text())
    assert content["first"] == "may.tif"
    assert content["volumes"][0]["net_m3"] == pytest.approx(found.volumes["net_m3"][0])
    page = (out / "change.html").read_text()
    assert "±" in page
    assert page.count("<img") == 2
    assert {path.name for path in out.iterdir()} == {"change.json", "change.tif", "change.csv", "change.html", "plots",
                                                     ".aerotri-files"}  # fmt: skip


def test_nothing_has_no_sigma(tmp_path):
    from typer.testing import CliRunner

    from aerotri.cli import app

    z = ground(X, Y)
    for name, more in (("may", 0.0), ("june", 1.0)):
        surface(z + more, np.random.default_rng(3), name).save(tmp_path / f"{name}.tif")
    files = [str(tmp_path / f"{name}.tif") for name in ("may", "june")]
    done = CliRunner().invoke(app, ["change", *files, "--align", "none", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    told = done.output
    assert "nothing lost" in told
    assert "gained 14" in told
    assert "0 ± 0" not in told + (tmp_path / "out" / "change.html").read_text()
    assert "no cell is beyond the level of detection" in (tmp_path / "out" / "change.html").read_text()


@pytest.mark.parametrize(
    ("settings", "says"),
    [({"align": "turn"}, "not known"), ({"noise_length": -1.0}, "not possible"), ({}, "has no σ"),
     ({"stable": "POLYGON ((0 0, 1 0, 1 1, 0 0))"}, "stable ground")],
)  # fmt: skip
def test_what_is_refused(settings, says):
    plain = aerotri.Surface.of_array(ground(X, Y), left=0.0, top=SIDE, cell=1.0)
    with pytest.raises(InputError, match=says):
        aerotri.change(plain, plain, **settings)


def test_little_stable_ground_does_not_tell_the_noise_length():
    first, second, _ = epochs(2, heap=False)
    small = aerotri.change(first, second, stable=shapely.box(0, 0, 12, 12), align="height")
    assert any("too little stable ground" in text for text in small.warnings)
    stated = aerotri.change(first, second, stable=shapely.box(0, 0, 12, 12), align="height", noise_length=WINDOW)
    assert stated.warnings == ()
    assert stated.summary["volumes"][0]["sigma_net_m3"] > small.summary["volumes"][0]["sigma_net_m3"]


def test_surfaces_without_sigma_take_it_from_stable_ground(tmp_path):
    """Nothing is said of a ratio to σ that nobody stated."""
    surfaces = []
    for one in epochs(3)[:2]:
        heights = one.heights
        grid = heights.grid
        surfaces.append(aerotri.Surface.of_array(heights.z, left=grid.left, top=grid.top, cell=grid.cell_x))
    found = aerotri.change(*surfaces, stable=STABLE, align="shift")
    known = aerotri.change(*epochs(3)[:2], stable=STABLE, align="shift")
    assert found.summary["alignment"]["noise_factor"] is None
    assert known.summary["alignment"]["noise_factor"] == pytest.approx(1.0, abs=0.2)
    assert found.summary["sigma_m"] == pytest.approx(known.summary["sigma_m"], rel=0.2)
    for one, said in ((found, "No σ was stated"), (known, "times the stated one")):
        one.save(tmp_path / said)
        (page,) = (tmp_path / said).glob("*.html")
        assert said in page.read_text(encoding="utf-8")


def test_surfaces_of_one_name_are_told_apart(tmp_path):
    for folder, left in (("old", 0.0), ("new", 1e4)):
        (tmp_path / folder).mkdir()
        flat = aerotri.Surface.of_array(np.full((9, 9), 1.0), left=left, top=0.0, cell=1.0)
        flat.save(tmp_path / folder / "dsm.tif")
    with pytest.raises(InputError, match=r"the surfaces old/dsm\.tif and new/dsm\.tif do not meet"):
        aerotri.change(tmp_path / "old" / "dsm.tif", tmp_path / "new" / "dsm.tif")
    (tmp_path / "new" / "dsm.tif").write_text("no raster")
    with pytest.raises(InputError, match=r"new.dsm\.tif: is no raster"):
        aerotri.change(tmp_path / "old" / "dsm.tif", tmp_path / "new" / "dsm.tif")


def test_surfaces_that_do_not_meet():
    first = epochs(1)[0]
    away = aerotri.Surface.of_array(first.z, left=1e4, top=0.0, cell=1.0)
    with pytest.raises(InputError, match="the surfaces may and surface do not meet"):
        aerotri.change(first, away)


def in_systems(folder, *systems):
    """Files of two surfaces in these systems, '' for none."""
    for k, (one, system) in enumerate(zip(epochs(3), systems, strict=False)):
        aerotri.Surface.of_array(
            one.z, left=0.0, top=SIDE, cell=1.0, sigma=one.sigma, crs=system or None, name=f"epoch_{k}"
        ).save(folder / f"epoch_{k}.tif")
    return folder / "epoch_0.tif", folder / "epoch_1.tif"


def test_system_of_heights_stands_in_the_head(tmp_path):
    found = aerotri.change(*in_systems(tmp_path, "EPSG:25832+7837", "EPSG:25832+7837"), align="none")
    head = found.summary
    assert (head["crs"], head["crs_name"]) == ("EPSG:25832+7837", "ETRS89 / UTM zone 32N")
    assert head["height_system"] == "DHHN2016 height"
    assert not any("system" in text for text in found.warnings)
    found.save(tmp_path / "change", plots=False)
    with rasterio.open(tmp_path / "change" / "change.tif") as file:
        assert file.crs.to_epsg() == 25832, "a difference is no height"


def test_system_of_heights_that_one_surface_states_alone_is_told(tmp_path):
    found = aerotri.change(*in_systems(tmp_path, "EPSG:25832+7837", "EPSG:25832"), align="none")
    assert found.summary["height_system"] == "DHHN2016 height"
    assert any("epoch_1.tif does not say in which system its heights are" in text for text in found.warnings)


def test_a_surface_without_a_system_is_told(tmp_path):
    said = "epoch_1.tif does not say its coordinate system; taken for EPSG:25832"
    assert any(said in text for text in aerotri.change(*in_systems(tmp_path, "EPSG:25832", ""), align="none").warnings)
    (tmp_path / "plain").mkdir()
    plain = aerotri.change(*in_systems(tmp_path / "plain", "", ""), align="none").warnings
    assert not any("coordinate system" in text for text in plain)


@pytest.mark.parametrize(
    ("systems", "said"),
    [(("EPSG:25832", "EPSG:25833"), "in EPSG:25833"), (("EPSG:25832+7837", "EPSG:25832+5783"), "heights of epoch_1")],
)
def test_surfaces_in_two_systems_are_refused(tmp_path, systems, said):
    with pytest.raises(InputError, match=said):
        aerotri.change(*in_systems(tmp_path, *systems), align="none")


def test_arguments_stand_in_the_file():
    found = aerotri.change(*epochs(3)[:2], stable=STABLE, area={"heap": AREA})
    used = {one["key"]: (one["value"], one["origin"]) for one in found.summary["settings"]}
    assert used == {
        "stable": ("Polygon", "given"), "align": ("shift", "default"), "area": ("heap", "given"),
        "noise_length": (None, "default"),
    }  # fmt: skip


def notes(**asked):
    return "\n".join(aerotri.change(**asked).summary["warnings"])


def test_stable_ground_that_is_none_is_told():
    first, second, _ = epochs(1)
    good = notes(first=first, second=second, stable=STABLE, align="tilt", area=AREA)
    assert "stable ground" not in good
    assert "dZ" not in good
    # what changed is stated to be stable
    said = notes(first=first, second=second, stable=AREA, align="height", area=AREA)
    assert "100 % of" in said
    assert "times what their σ says" in said
    # everywhere, where no area is asked for, is no contradiction
    assert "% of" not in notes(first=first, second=second, stable=STABLE, align="tilt")


@pytest.mark.parametrize(("by", "said"), [(47.3, "m higher than the first"), (-47.3, "m lower than the first")])
def test_a_lift_between_systems_of_heights_is_told(by, said):
    first, second, _ = epochs(2)
    moved = aerotri.Surface.of_array(
        second.z + by, left=0.0, top=SIDE, cell=1.0, sigma=second.sigma, name="above the ellipsoid"
    )
    found = notes(first=first, second=moved, stable=STABLE, align="tilt", area=AREA)
    assert said in found
    assert ("was lowered" if by > 0.0 else "was raised") in found


def test_cells_beside_holes_and_edges_count():
    """Places of cells are rounded: interpolation between them would lose what has a neighbour without a height."""
    z = 100.0 + np.random.default_rng(4).normal(size=(60, 60))
    z[20:22, 30:32] = np.nan
    first, second = (
        aerotri.Surface.of_array(
            z + up, left=500000.1, top=5600000.7, cell=0.1, sigma=np.full(z.shape, 0.02), name=str(up)
        )
        for up in (0.0, 1.0)
    )
    for area in (None, shapely.box(500001.1, 5599995.7, 500005.1, 5599999.7)):
        found = aerotri.change(first, second, align="none", area=area)
        cells = 3596 if area is None else 1600 - 4
        assert found.summary["volumes"][0]["net_m3"] == pytest.approx(0.01 * cells, rel=1e-6)


@pytest.mark.parametrize("wrong", [0.0, -0.03])
@pytest.mark.parametrize("stable", [None, STABLE])
def test_no_sigma_is_refused(wrong, stable):
    first, second, _ = epochs(3)
    sigma = second.sigma.copy()
    sigma[3, 4:6] = wrong
    second = aerotri.Surface.of_array(second.z, left=0.0, top=SIDE, cell=1.0, sigma=sigma, name="june")
    with pytest.raises(InputError, match=r"june.*2 cells with a height have a σ of zero or less"):
        aerotri.change(first, second, stable=stable, align="none", area=AREA)


def test_a_surface_and_a_cloud_are_refused_as_that(tmp_path):
    from aerotri.cli.app import invoke

    for first, second in (("a.tif", "b.laz"), ("b.laz", "a.tif")):
        with pytest.raises(aerotri.InputError, match=r"a.tif is a surface and b.laz a point cloud"):
            invoke(["change", first, second])


def test_surfaces_and_stable_ground_apart_are_told_by_place():
    flat = np.full((30, 30), 100.0)
    first, second, far = (
        aerotri.Surface.of_array(flat, left=left, top=530.0, cell=1.0, sigma=np.full(flat.shape, 0.02))
        for left in (500.0, 505.0, 900.0)
    )
    with pytest.raises(aerotri.InputError, match=r"X 500 to 530, Y 500 to 530.* lies at X 900 to 930"):
        aerotri.change(first, far)
    beside = "POLYGON ((700 700, 720 700, 720 720, 700 720, 700 700))"
    with pytest.raises(aerotri.InputError, match="no cell that both surfaces have: it lies at X 700 to 720") as refused:
        aerotri.change(first, second, stable=beside)
    assert "inside both surfaces" in refused.value.remedy


def test_what_is_nothing_beside_sigma_of_net_is_told_as_that(tmp_path):
    """One small cell beyond the level of detection in a large area: no number with many digits."""
    flat = np.full((60, 60), 100.0)
    changed = flat.copy()
    changed[5, 5] += 0.08
    first, second = (
        aerotri.Surface.of_array(z, left=500.0, top=503.0, cell=0.05, sigma=np.full(flat.shape, 0.02))
        for z in (flat, changed)
    )
    found = aerotri.change(first, second, align="none", noise_length=2.0)
    volume = found.summary["volumes"][0]
    assert 0.0 < volume["gained_m3"] < 0.01 * volume["sigma_net_m3"]
    least = at_most(volume, "gained")
    assert volume["gained_m3"] < least <= 0.1 * volume["sigma_net_m3"]
    assert at_most(volume, "net") is None
    assert at_most(volume | {"gained_m3": volume["sigma_net_m3"]}, "gained") is None
    page = (found.save(tmp_path / "change") / "change.html").read_text(encoding="utf-8")
    assert f"less than {least:g} m³" in page
    assert f"gained less than {least:g} m³" in "\n".join(_summary(found.summary))
    assert "that of the matching" not in page
    assert "as stated" in page
