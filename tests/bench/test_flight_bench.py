"""The bench of a planned flight: what it shows is the plan, and another plan is made beside it."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from browser import Watched, browser, served

import aerotri
from aerotri.bench.flight_bench import FlightBench
from aerotri.bench.flight_plan import LAYERS
from aerotri.bench.flight_request import changed_request, texts_of
from aerotri.conventions import InputError
from planned_flights import TRIANGLE

HOSTILE = "<img src=x onerror=document.title='hacked'>"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    plan = aerotri.plan_flight(TRIANGLE, camera="p1", gsd=0.03, ground=100.0, control=5, tie_points=60)
    return plan, plan.save(tmp_path_factory.mktemp("flight_bench") / "pit_plan")


@pytest.fixture
def folder(made, tmp_path):
    return shutil.copytree(made[1], tmp_path / "pit_plan")


def test_map_is_that_of_the_plan(made, folder):
    plan, content = made[0], FlightBench(folder).content()
    origin = np.array(content["origin"])
    assert np.array(content["exposures"]["xy"]) + origin == pytest.approx(plan.record.flight.centre[:, :2], abs=0.02)
    ground = plan.record.ground_points[:, :2] - origin
    places = np.array(content["cells"]["xy"])
    half = content["cells"]["size"] / 2
    expected = dict(zip(LAYERS[:2], (plan.record.sigma[:, 2], plan.record.deformation[:, 2]), strict=True))
    for place, *values in zip(places, *(content["cells"]["values"][name] for name in expected), strict=True):
        own = np.flatnonzero((np.abs(ground - place) <= half + 0.01).all(axis=1))
        for value, of_points in zip(values, expected.values(), strict=True):
            assert np.abs(of_points[own] - value).min() < 1e-4
    sides = np.linalg.norm(np.diff(np.array(content["footprints"])[:, :3], axis=1), axis=2)
    assert np.sort(sides, axis=1) == pytest.approx(np.tile(np.array([5460, 8192]) * 0.03, (len(sides), 1)), rel=0.01)


def test_planned_again_beside_the_plan_which_stays(folder):
    before = (folder / "plan.json").read_bytes()
    bench = FlightBench(folder)
    bench.again({"side_overlap": "0.75", "control": "6"})
    bench.wait()
    assert bench.state()["job"]["error"] == ""
    said = bench.summary()
    assert (said["shown"], said["before"], said["plans"]) == ("plan_001", "pit_plan", ["pit_plan", "plan_001"])
    rows = {one["what"]: (one["before"], one["now"]) for one in said["numbers"]}
    assert rows["side overlap, at least"][1] >= 75.0 > rows["side overlap, at least"][0]
    assert rows["control points"] == (5, 6)
    assert (folder / "plan.json").read_bytes() == before
    assert json.loads((folder.parent / "pit_bench" / "plan_001" / "request.json").read_text())["control"] == 6
    again = FlightBench(folder.parent / "pit_bench" / "plan_001")
    again.choose("plan_001")
    with pytest.raises(InputError, match="there is no plan"):
        again.choose("../pit_plan")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gsd": "small"}, "gsd 'small' is not a number"), ({"control": "-1"}, "control '-1' is no whole number"),
        ({"control_sigma": "1,2,3"}, "one number or two"), ({"dem": "/etc/passwd"}, "cannot be changed"),
        ({"gsd": "nan"}, "is not a number"),
    ],
)  # fmt: skip
def test_values_that_are_not_possible(folder, given, message):
    bench = FlightBench(folder)
    with pytest.raises(InputError, match=message):
        bench.again(given)
    assert bench.state()["job"] is None


def test_fields_that_were_not_touched_change_nothing(made):
    request = json.loads((made[1] / "request.json").read_text())
    assert changed_request(request, texts_of(request)) == request


def test_what_planning_refuses_is_told(folder):
    bench = FlightBench(folder)
    bench.again({"forward_overlap": "0.99"})
    bench.wait()
    assert "forward overlap 0.99 is not possible" in bench.state()["job"]["error"]
    assert bench.generation == 1


def test_damaged_folder_is_told(folder):
    (folder / "waypoints.csv").unlink()
    with pytest.raises(InputError, match=r"waypoints.csv: is missing"):
        FlightBench(folder).content()
    (folder / "plan.json").write_text("[]")
    with pytest.raises(InputError, match="no record of a plan"):
        FlightBench(folder)


def test_page_in_a_browser(folder):
    record = json.loads((folder / "plan.json").read_text())
    record["area"]["name"] = HOSTILE
    (folder / "plan.json").write_text(json.dumps(record))
    pytest.importorskip("starlette", reason="the bench takes the extra 'view'")
    with browser() as chromium, served(FlightBench(folder)) as address:
        watched = Watched(chromium)
        watched.open(address)
        p = watched.page
        assert p.inner_text("#name") == f"Plan of {HOSTILE}"
        assert p.locator("#control tbody tr").count() == 5
        p.select_option("#plan-bar select", "photographs")
        assert "photographs" in p.inner_text("#legend")
        p.click("#control tbody tr:nth-child(2)")
        assert p.evaluate("bench.map.chosen") == 1
        coloured = """() => { const c = document.getElementById('plan'), s = bench.map.surface;
            const [x, y] = s.screen(...bench.content.cells.xy[0]), r = window.devicePixelRatio;
            return [...c.getContext('2d').getImageData(x * r, y * r, 1, 1).data]; }"""
        p.click("#plan-bar button")
        p.wait_for_function(f"({coloured})()[3] === 255")
        p.fill("#field-gsd", "nonsense")
        p.click("#again")
        p.wait_for_selector("#message:not([hidden])")
        assert "is not a number" in p.inner_text("#message")
        p.fill("#field-gsd", "0.04")
        p.click("#again")
        p.wait_for_selector("body[data-job='running'], body[data-generation='2']")
        p.fill("#field-direction", "30")
        p.wait_for_selector("body[data-generation='2']", timeout=120_000)
        assert p.input_value("#field-direction") == "30"  # typed while the plan was made
        assert "plan_001" in p.inner_text("#numbers thead")
        p.select_option("#actions select", "pit_plan")
        p.wait_for_selector("body[data-generation='3']")
        assert p.input_value("#field-direction") != "30"
        assert p.title() == f"{HOSTILE} – aerotri plan"
        assert watched.errors == []
        assert watched.hosts <= {"127.0.0.1", "data:"}
        p.close()
