"""What is decided on the bench: marks and switches, undone, adjusted again and compared."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.formats.block.folder import read_block


def worst(client) -> tuple[int, int, list[float]]:
    rows = client.get("data/rays").json()["rows"]
    return rows["image"][0], rows["point"][0], rows["px"][0]


def names(client) -> tuple[list[str], list[str]]:
    plan = client.get("data/plan").json()
    return plan["images"]["name"], plan["points"]["name"]


def moved(client) -> tuple[int, int, dict]:
    image, point, px = worst(client)
    place = {"image": image, "point": names(client)[1][point], "column": px[0] + 1.5, "row": px[1] - 2.0}
    return image, point, client.post("act/mark", json=place).json()


def test_moved_mark_is_saved_beside_the_result_which_stays(client, bench, result):
    before = (result / "block" / "image_points.csv").read_bytes()
    image, point, said = moved(client)
    assert [(one["kind"], one["image"], one["point"]) for one in said["changes"]] == [("moved", image, point)]
    assert (result / "block" / "image_points.csv").read_bytes() == before
    assert not (result / "block" / "edits.csv").exists()
    block = read_block(bench.places.block)
    row = int(np.flatnonzero((block.image_points.image == image) & (block.image_points.point == point))[0])
    change = block.image_points.xy[row] - bench.records.block.image_points.xy[row]
    pixel = block.cameras[0].pixel_mm
    assert change == pytest.approx([1.5 * pixel, 2.0 * pixel], abs=0.001 * pixel)


def test_undo_leaves_nothing_to_adjust(client):
    moved(client)
    said = client.post("act/undo").json()
    assert (said["changes"], said["can_undo"]) == ([], False)
    found = client.post("act/undo")
    assert found.status_code == 400
    assert "nothing is left" in found.json()["error"]


def test_bench_opened_again_knows_the_decisions(client, bench, result):
    from aerotri.bench.places import places_of
    from aerotri.bench.session import Bench

    _, _, said = moved(client)
    bench.wait()
    again = Bench(places_of(result))
    assert again.measuring.edits()["changes"] == said["changes"]
    again.wait()


def test_switches_take_a_reason(client):
    image, point, _ = worst(client)
    name = names(client)[1][point]
    refused = client.post("act/switch", json={"image": image, "point": name, "action": "off"})
    assert refused.status_code == 400
    assert "needs a reason" in refused.json()["error"]
    said = client.post("act/switch", json={"image": image, "point": name, "action": "off", "reason": "blurred"}).json()
    assert [(one["kind"], one["reason"]) for one in said["changes"]] == [("off", "blurred")]
    said = client.post("act/switch", json={"image": image, "point": name, "action": "on", "reason": "sharp"}).json()
    assert said["changes"] == []


def test_control_becomes_check_and_tie_points_do_not(client, bench):
    block = bench.records.block
    control = str(block.points[block.control.point[~block.control.is_check][0]])
    said = client.post("act/switch", json={"point": control, "action": "check", "reason": "test"}).json()
    assert [one["kind"] for one in said["changes"]] == ["check"]
    tie = next(name for name in block.points.tolist() if name not in block.points[block.control.point])
    found = client.post("act/switch", json={"point": tie, "action": "check", "reason": "test"})
    assert "is no control or check point" in found.json()["error"]


@pytest.mark.parametrize(
    ("action", "content"),
    [
        ("mark", {"image": 0, "point": "x", "column": -5, "row": 10}),
        ("mark", {"image": 0, "point": "x", "column": "1", "row": 10}),
        ("mark", {"image": 10**6, "point": "x", "column": 1, "row": 10}),
        ("mark", {"image": True, "point": "x", "column": 1, "row": 10}),
        ("mark", {"image": 0, "point": " ", "column": 1, "row": 10}),
        ("mark", {"image": 0, "point": "a\nb", "column": 1, "row": 10}),
        ("mark", {"image": 0, "point": "x" * 5000, "column": 1, "row": 10}),
        ("remove", {"image": 0, "point": "no such point"}),
        ("switch", {"image": 0, "point": "no such point", "action": "off", "reason": "r"}),
        ("switch", {"image": 0, "point": "x", "action": "undo", "reason": "r"}),
        ("mark", []),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_is_written(client, bench, action, content):
    found = client.post(f"act/{action}", json=content)
    assert found.status_code == 400
    assert "—" in found.json()["error"]
    assert not bench.places.bench.exists()


def test_actions_ask_for_the_token_too(client):
    assert client.post("http://127.0.0.1/wrong/act/undo").status_code == 403
    assert client.get("act/undo").status_code == 405
    assert client.post("act/mark", content=b"{").status_code == 400


def test_adjusted_again_the_difference_is_that_of_the_mark(client, bench):
    image, point, _ = worst(client)
    before = bench.records.sigma[point].copy()
    name = names(client)[1][point]
    client.post("act/switch", json={"image": image, "point": name, "action": "off", "reason": "wrong point"})
    assert client.post("act/adjust").json()["job"]["running"]
    bench.wait()
    state = client.get("data/state").json()
    assert state["job"]["error"] == ""
    assert state["generation"] == 2
    assert client.get("data/edits").json()["changes"] == []
    told = client.get("data/difference").json()
    used = next(table for table in told["tables"] if table["title"].startswith("Rays used differently"))
    assert [row[1:3] for row in used["rows"]] == [[names(client)[0][image], name]]
    assert client.get("data/summary").json()["result"] == "result_001"
    row = np.flatnonzero(bench.records.block.image_points.point == point)
    assert "off" in bench.records.status[row].tolist()
    assert (bench.records.sigma[point] > before).any()
    client.post("act/undo")
    assert [one["kind"] for one in client.get("data/edits").json()["changes"]] == ["on"]


def test_mark_taken_back_after_the_adjustment_is_open_again(client, bench):
    image, point, _ = moved(client)
    client.post("act/adjust")
    bench.wait()
    assert client.get("data/edits").json()["changes"] == []
    said = client.post("act/undo").json()
    assert [(one["kind"], one["image"], one["point"]) for one in said["changes"]] == [("moved", image, point)]
    before = bench.records.block.image_points.xy.copy()
    client.post("act/adjust")
    bench.wait()
    rays = bench.records.block.image_points
    row = np.flatnonzero((rays.image == image) & (rays.point == point))
    pixel = bench.records.block.cameras[0].pixel_mm
    change = bench.records.block.image_points.xy[row] - before[row]
    assert change[0] == pytest.approx([-1.5 * pixel, -2.0 * pixel], abs=0.001 * pixel)
