"""The bench driven in a real browser, as an operator does."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from browser import Watched, browser, served

import aerotri
from aerotri.bench.places import places_of
from aerotri.bench.session import Bench
from small_blocks import small_block

pytest.importorskip("starlette", reason="the bench takes the extra 'view'")
# whether every row of the table names a photograph or point
ONLY = "name => [...document.querySelectorAll('#rays tbody tr')].every(r => r.innerText.includes(name))"
HOSTILE = ("<img src=x onerror=document.title='hacked'>", '"><script>alert(1)</script>', "a & b 'c' Größe")


@pytest.fixture(scope="module")
def chromium():
    with browser() as started:
        yield started


@pytest.fixture
def page(chromium, bench):
    with served(bench) as address:
        watched = Watched(chromium)
        watched.address = address
        watched.open(address)
        yield watched
        watched.page.close()
    assert watched.hosts <= {"127.0.0.1", "data:"}
    assert watched.errors == []


def texts(page, selector: str) -> list[str]:
    return page.locator(selector).all_inner_texts()


def test_worst_ray_is_found_its_mark_moved_adjusted_compared_and_taken_back(page, bench):
    p = page.page
    worst = texts(p, "#rays tbody tr:first-child td")
    sizes = [float(text) for text in texts(p, "#rays tbody td.size")]
    assert sizes == sorted(sizes, reverse=True)
    p.click("#rays tbody tr:first-child")
    p.wait_for_selector(f"body[data-shown='{worst[3]} {worst[4]}']")
    p.uncheck("#photo-bar label:has-text('snap') input")
    # the mark stands in the middle: it is taken by the mouse and let go elsewhere
    box = p.locator("#photo").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    before = p.evaluate("bench.photo.placeOf(bench.chosen.point)")
    scale = p.evaluate("bench.photo.surface.scale")
    p.mouse.move(x, y)
    p.mouse.down()
    p.mouse.move(x + 12, y + 6, steps=4)
    p.mouse.up()
    p.wait_for_selector("body[data-changes='1']")
    after = p.evaluate("bench.photo.placeOf(bench.chosen.point)")
    assert np.subtract(after, before) == pytest.approx([12 / scale, 6 / scale], abs=0.6 / scale)
    p.wait_for_selector("body[data-equations=ready]", timeout=60_000)
    p.check("#plan-bar label:has-text('ellipses') input")
    p.wait_for_function("bench.plan.ellipses")
    p.click("#adjust")
    p.wait_for_selector("body[data-generation='2']", timeout=120_000)
    p.wait_for_selector("body[data-equations=ready]", timeout=60_000)
    p.wait_for_selector("#verdicts", timeout=30_000)
    # those of the new result come by themselves
    p.wait_for_function("bench.plan.ellipses", timeout=30_000)
    assert "result_001" in p.inner_text("#outcome")
    assert p.evaluate("document.body.dataset.changes") == "0"
    p.click("#undo")
    p.wait_for_selector("body[data-changes='1']")
    p.click("#tab-edits")
    assert "mark moved" in p.inner_text("#sheet")
    assert len(bench.measuring.decisions.rows) == 2


def test_ray_is_switched_off_with_a_reason(page):
    p = page.page
    p.click("#rays tbody tr:first-child")
    p.click("#tab-point")
    p.click("#ray-off")
    p.wait_for_selector("#message:not([hidden])")
    assert "needs a reason" in p.inner_text("#message")
    p.fill("#reason", "blurred <b>here</b>")
    p.click("#ray-off")
    p.wait_for_selector("body[data-changes='1']")
    p.click("#tab-rays")
    p.wait_for_selector("#rays tr.off")
    assert texts(p, "#rays tr.off td:last-child") == ["switched off"]
    p.click("#tab-edits")
    assert "blurred <b>here</b>" in p.inner_text("#sheet")
    p.keyboard.press("Control+z")
    p.wait_for_selector("body[data-changes='0']")


def test_point_chosen_in_the_plan_is_that_under_the_mouse(page):
    p = page.page
    at = p.evaluate("""() => { const plan = bench.plan, k = plan.groups.find(rows => rows.length)[0];
        Object.assign(plan.surface, {x: plan.x[k], y: plan.y[k], scale: 5}); plan.surface.redraw(); return k; }""")
    box = p.locator("#plan").bounding_box()
    p.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    p.wait_for_function(f"bench.chosen.point === {at}")
    p.click("#tab-point")
    assert p.inner_text("#point-name") == p.evaluate(f"bench.names.points[{at}]")
    assert p.locator(".cutouts figure").count() >= p.evaluate("bench.pointContent.rays.ray.length")


def test_legend_says_what_the_colours_of_the_points_mean(page):
    p = page.page
    assert "largest |w|" in p.inner_text("#legend b")
    assert texts(p, "#legend span")[0] == "below 1"
    p.select_option("#plan-bar select", "sigma")
    assert "σ in space" in p.inner_text("#legend b")
    steps = texts(p, "#legend span")
    assert len(steps) == 6
    assert all(text.split()[-1] in ("mm", "cm", "m") for text in steps[:-1])
    p.uncheck("#plan-bar label:has-text('points') input")
    assert p.is_hidden("#legend")


def test_lengths_of_scale_bars_are_round_and_in_fitting_units(page):
    said = page.page.evaluate("""async () => { const { roundLength, metres } = await import('./legend.js');
        return [[730, 5], [0.0371, 2], [199, 1]].map(([most]) => metres(roundLength(most))); }""")
    assert said == ["500 m", "2 cm", "100 m"]


def test_the_whole_block_stands_beside_the_legend_and_above_the_bars(page):
    over = page.page.evaluate("""() => { bench.plan.fit();
        const plan = bench.plan, box = e => e.getBoundingClientRect(), canvas = box(plan.surface.canvas);
        const legend = box(document.getElementById('legend')), [low, high] = plan.bounds();
        const [left, bottom] = plan.surface.screen(...low), [right, top] = plan.surface.screen(...high);
        return { inside: left >= 0 && top >= 0 && right <= canvas.width && bottom <= canvas.height - 51,
            covered: right > legend.left - canvas.left && bottom > legend.top - canvas.top }; }""")
    assert over == {"inside": True, "covered": False}


def test_space_shows_points_and_centres_whole_from_every_side(page):
    p = page.page
    p.click("#tab-space")
    p.wait_for_selector("#space")
    outside = p.evaluate("""() => { const space = bench.tabs.space[1], { points, images } = bench.plan.content;
        let count = 0;
        for (const [turn, tilt] of [[0, 0], [0.6, 0.5], [2.1, 1.5], [4.0, 0.9]]) {
          Object.assign(space, { turn, tilt });
          const at = space.view(900, 300);
          for (const place of [...points.xyz, ...images.centre]) {
            if (place[0] === null || place[2] === null) continue;
            const [x, y] = at(...place);
            if (x < 0 || y < 0 || x > 900 || y > 300) count++;
          }
        }
        return count; }""")
    assert outside == 0


def test_next_mark_leads_to_its_place_and_space_is_drawn(page, bench):
    p = page.page
    p.wait_for_selector("body[data-equations=ready]")
    p.click("#tab-next")
    p.wait_for_selector("#next tbody tr")
    less = [float(text.split()[0]) for text in texts(p, "#next tbody td:last-child")]
    assert less == sorted(less, reverse=True)
    point, photograph = texts(p, "#next tbody tr:first-child td")[:2]
    p.click("#next tbody tr:first-child")
    p.wait_for_selector(f"body[data-shown='{photograph} {point.removesuffix(' (control)')}']")
    assert not p.is_disabled("#set-mark")
    p.click("#set-mark")
    box = p.locator("#photo").bounding_box()
    p.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    p.wait_for_selector("body[data-changes='1']")
    assert bench.measuring.decisions.rows[-1].image == photograph
    p.click("#tab-space")
    p.wait_for_selector("#space")
    drawn = """() => { const c = document.getElementById('space');
        const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        let n = 0; for (let k = 3; k < d.length; k += 4) if (d[k]) n++; return n; }"""
    assert p.evaluate(drawn) > 1000


def test_new_control_point_is_made_by_marks_in_two_photographs_and_taken_back(page, bench):
    p = page.page
    p.click("#tab-fresh")
    p.fill("#new-name", HOSTILE[0])
    p.select_option("#sheet select", "new_control")
    p.click("#new-begin")
    p.wait_for_selector("#message:not([hidden])")
    assert "not a number" in p.inner_text("#message")
    for k, value in enumerate(("100.5", "200.25", "30", "0.02", "0.02", "0.03")):
        p.fill(f"#new-{k}", value)
    p.click("#new-begin")
    p.wait_for_selector("body[data-changes='1']")
    for k in (0, 1):
        p.select_option("#photo-bar select", str(k))
        p.wait_for_function(f"bench.photo.content && bench.photo.content.image === {k}")
        p.click("#set-mark")
        box = p.locator("#photo").bounding_box()
        p.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        p.wait_for_selector(f"body[data-changes='{k + 2}']")
    assert "2 marks" in p.inner_text("#new-marks")
    assert [one.action for one in bench.measuring.decisions.rows] == ["new_control", "mark", "mark"]
    assert bench.measuring.decisions.rows[0].given == (100.5, 200.25, 30.0, 0.02, 0.02, 0.03)
    for left in (2, 1, 0):
        p.click("#undo")
        p.wait_for_selector(f"body[data-changes='{left}']")


def test_wrong_token_is_refused(page, chromium):
    other = Watched(chromium)
    answer = other.page.goto(page.address.rsplit("/", 2)[0] + "/wrong/")
    assert answer.status == 403
    assert "small" not in other.page.content()
    other.page.close()


def test_hostile_names_stay_text(chromium, tmp_path):
    block, _ = small_block(seed=4)
    names, points = block.images.names.astype("<U80"), block.points.astype("<U80")
    names[: len(HOSTILE)] = HOSTILE
    points[block.control.point[: len(HOSTILE)]] = HOSTILE
    hostile = replace(block, name="<script>document.title='hacked'</script>", points=points,
                      images=replace(block.images, names=names))  # fmt: skip
    folder = aerotri.adjust(hostile).save(tmp_path / "hostile_result", plots=False)
    bench = Bench(places_of(folder))
    with served(bench) as address:
        watched = Watched(chromium)
        watched.open(address)
        p = watched.page
        assert p.inner_text("#name").startswith("<script>")
        for name in HOSTILE:
            p.fill("#filter", name)
            p.press("#filter", "Enter")
            p.wait_for_function(ONLY, arg=name)
            p.click("#rays tbody tr:first-child")
            p.click("#tab-point")
            p.click("#tab-rays")
        assert p.title() == "<script>document.title='hacked'</script> – aerotri bench"
        assert p.locator("img[src=x], #sheet script").count() == 0
        assert watched.errors == []
        assert watched.hosts <= {"127.0.0.1", "data:"}
        p.close()
    bench.wait()


def test_text_being_typed_outlives_a_table_drawn_anew(page):
    p = page.page
    every = p.locator("#rays tbody tr").count()
    name = texts(p, "#rays tbody tr:first-child td")[3]
    p.click("#filter")
    p.keyboard.type(name[:-1])
    # as when a photograph has come, or the equations are ready
    p.evaluate("bench.showTab()")
    p.keyboard.type(name[-1])
    assert p.input_value("#filter") == name
    p.keyboard.press("Enter")
    p.wait_for_function(ONLY, arg=name)
    assert 0 < p.locator("#rays tbody tr").count() < every
    p.click("#tab-point")
    p.click("#tab-rays")
    p.wait_for_selector("#rays tbody tr")
    assert p.input_value("#filter") == name


def test_late_answer_does_not_write_over_a_later_one(page):
    p = page.page
    every = p.locator("#rays tbody tr").count()
    name = texts(p, "#rays tbody tr:first-child td")[3]
    held = []
    p.route("**/data/rays*", lambda route: route.continue_() if held else held.append(route))
    p.evaluate("void bench.showTab()")
    while not held:
        p.wait_for_timeout(20)
    p.fill("#filter", name)
    p.press("#filter", "Enter")
    p.wait_for_function(ONLY, arg=name)
    with p.expect_response("**/data/rays*"):
        held[0].continue_()
    p.wait_for_timeout(200)
    assert 0 < p.locator("#rays tbody tr").count() < every


def test_reason_is_given_once(page, bench):
    p = page.page
    p.click("#rays tbody tr:first-child")
    p.click("#tab-point")
    p.click("#reason")
    p.keyboard.type("bl")
    p.evaluate("bench.showTab()")
    p.keyboard.type("urred")
    p.click("#ray-off")
    p.wait_for_selector("body[data-changes='1']")
    assert bench.measuring.decisions.rows[0].reason == "blurred"
    # what the field shows is what the next decision is given
    assert p.input_value("#reason") == ""


@pytest.fixture(scope="module")
def large_block(tmp_path_factory):
    """A block of more than 10 000 points."""
    changes = {"tie_points": {"per_image": 1800, "probability": 0.9, "sigma_um": 2.0}}
    block, _ = small_block(seed=1, **changes)
    folder = tmp_path_factory.mktemp("large") / "large"
    from aerotri.formats.block.folder import write_block

    write_block(block, folder)
    return folder, len(block.points)


def test_ten_thousand_points_stay_fluid(chromium, large_block):
    folder, count = large_block
    assert count > 10_000
    bench = Bench(places_of(folder))
    # places of the points without an adjustment: what is tested is the drawing
    rng = np.random.default_rng(1)
    xyz = np.column_stack([rng.uniform(-2000, 2000, (count, 2)), np.zeros(count)])
    records = replace(bench.records, xyz=xyz, largest_w=rng.uniform(0, 6, count))
    bench.shown = replace(bench.shown, records=records)
    with served(bench) as address:
        watched = Watched(chromium)
        watched.open(address)
        assert watched.page.evaluate("bench.plan.count") == count
        milliseconds = watched.page.evaluate("""() => { const s = bench.plan.surface, begun = performance.now();
            for (let k = 0; k < 30; k++) { s.x += 5; s.scale *= 1.01; s.drawNow(); }
            bench.plan.surface.canvas.getContext("2d").getImageData(0, 0, 1, 1);
            return (performance.now() - begun) / 30; }""")
        watched.page.close()
    assert milliseconds < 100.0, "a busy machine takes several times the usual 10 ms"


@pytest.mark.slow
def test_581_photographs_are_open_before_their_equations(chromium, shared_data, documented_result):
    """The page serves while the equations follow behind it."""
    bench = Bench(places_of(documented_result))
    with served(bench) as address:
        watched = Watched(chromium)
        watched.open(address)
        assert watched.page.evaluate("bench.names.images.length") == 581
        watched.page.click("#rays tbody tr:first-child")
        watched.page.wait_for_function("bench.photo.content !== undefined")
        watched.page.close()
    bench.wait()


@pytest.fixture
def documented_result(shared_data, tmp_path_factory, request):
    """The block CU-SBR converted and adjusted, once for all runs of the tests on one machine."""
    from aerotri.cli.app import invoke

    data, kept = shared_data("cu_sbr_p1"), tmp_path_factory.mktemp("cu_sbr")
    block, result = kept / "p1", kept / "p1_result"
    invoke(["convert", str(data / "tp_bingo.txt"), "--out", str(block), "--positions", str(data / "gnss_positions.csv"),
            "--gnss-shift", "off", "--control", str(data / "control_points.csv"), "--control-prefix", "GCP_",
            "--camera-name", "P1", "--camera-size", "8192x5460", "--pixel-um", "4.27246", "--focal-length-mm", "35.01",
            "--free-interior", "--image-sigma-px", "0.5", "--crs", "EPSG:32647"])  # fmt: skip
    invoke(["adjust", str(block), "--out", str(result), "--parameters", "brown:K1+K2+K3+P1+P2", "--robust", "huber",
            "--no-plots"])  # fmt: skip
    yield result
    shutil.rmtree(kept)
