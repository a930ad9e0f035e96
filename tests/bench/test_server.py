"""What the server of the bench lets through, and what it says of a result."""

from __future__ import annotations

import numpy as np
import pytest

import aerotri


@pytest.mark.parametrize("path", ["/", "/wrong/", "/wrong/data/plan", "/the-toke/", "/the-token2/data/plan", "//"])
def test_wrong_token_is_refused(client, path):
    found = client.get(f"http://127.0.0.1{path}")
    assert found.status_code == 403
    assert "small" not in found.text


def test_name_that_leads_here_from_elsewhere_is_refused(client):
    for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example"):
        assert client.get("data/plan", headers={"host": host}).status_code == 403
    assert client.get("data/plan", headers={"host": "localhost:8000"}).status_code == 200


def test_page_loads_nothing_from_elsewhere(client):
    found = client.get("")
    assert found.status_code == 200
    assert "default-src 'none'" in found.headers["content-security-policy"]
    for name in ("", "main.js", "plan.js", "surface.js", "bench.css", "api.js"):
        text = client.get(name).text
        assert not any(word in text for word in ("http://", "https://", "innerHTML"))
    assert client.get("../session.py").status_code in (403, 404)
    assert client.get("session.py").status_code == 404


def test_rays_are_those_of_the_result_worst_first(client, result):
    opened = aerotri.open_result(result)
    table = client.get("data/rays").json()
    w = opened.adjusted.rays.w
    size = np.nanmax(np.abs(w), axis=1)
    assert table["count"] == len(size)
    assert table["rows"]["size"][0] == pytest.approx(np.nanmax(size), abs=0.01)
    assert table["rows"]["ray"][0] == int(np.nanargmax(size))
    assert table["rows"]["size"] == sorted(table["rows"]["size"], reverse=True)


def test_pixels_and_residuals_of_rays(client, result):
    opened = aerotri.open_result(result)
    block, rows = opened.block, client.get("data/rays").json()["rows"]
    camera = block.cameras[0]
    ray = rows["ray"][0]
    x, y = block.image_points.xy[ray]
    expected = (x / camera.pixel_mm + camera.size_px[0] / 2, camera.size_px[1] / 2 - y / camera.pixel_mm)
    assert rows["px"][0] == pytest.approx(expected, abs=1e-3)
    vx, vy = opened.adjusted.rays.v[ray] / camera.pixel_mm
    assert rows["v"][0] == pytest.approx((vx, -vy), abs=1e-3)


def test_rays_of_a_point_and_by_text(client):
    first = client.get("data/rays").json()["rows"]
    point = first["point"][0]
    own = client.get("data/rays", params={"point": point}).json()
    assert own["count"] == len(client.get(f"data/point/{point}").json()["rays"]["ray"])
    assert set(own["rows"]["point"]) == {point}
    name = client.get("data/plan").json()["images"]["name"][first["image"][0]]
    named = client.get("data/rays", params={"text": name.upper()}).json()
    assert first["image"][0] in named["rows"]["image"]
    assert client.get("data/rays", params={"text": "no such thing"}).json()["count"] == 0


def test_plan_holds_points_and_footprints_on_the_ground(client, result):
    opened = aerotri.open_result(result)
    plan = client.get("data/plan").json()
    xyz = np.array(plan["points"]["xyz"], dtype=float) + plan["origin"]
    assert np.allclose(xyz, opened.adjusted.points.xyz, atol=1e-3)
    footprint = np.array(plan["images"]["footprint"], dtype=float) + plan["origin"][:2]
    centre = opened.adjusted.images.centre
    assert np.abs(footprint.mean(axis=1) - centre[:, :2]).max() < 200.0
    width = np.linalg.norm(footprint[:, 1] - footprint[:, 0], axis=1)
    assert width == pytest.approx(np.full(len(width), 0.1 * 11500), rel=0.15)
    assert sorted(k for strip in plan["strips"] for k in strip["images"]) == list(range(len(centre)))
    differences = np.array([d for d in plan["control"]["difference"]], dtype=float)
    both = np.concatenate([opened.adjusted.control.difference, opened.adjusted.check.difference])
    assert np.sort(differences[:, 2]) == pytest.approx(np.sort(both[:, 2]), abs=1e-4)


@pytest.mark.parametrize(
    "path", ["data/point/999999", "data/photograph/999999", "data/rays?first=x", "data/rays?image=-1"]
)
def test_rows_that_are_not_there_are_told(client, path):
    found = client.get(path)
    assert found.status_code == 400
    assert "—" in found.json()["error"]


def test_hostile_names_stay_text(client):
    """Names come as JSON, never in a page; no page holds a place for a name."""
    assert client.get("data/plan").headers["content-type"] == "application/json"
    assert "{{" not in client.get("").text


def test_numbers_of_many_digits_are_the_askers_mistake(client):
    """Rows that no array has, and numbers that Python does not read."""
    for digits in (10, 19, 400, 4400):
        for path in ("data/point/{}", "data/epipolar/0/{}", "tile/{}/0/0/0", "cutout/0?left={}&top=0&size=9"):
            assert 400 <= client.get(path.format("9" * digits)).status_code < 500
