"""Take the picture of the bench: `python docs/figures/bench.py`. Takes playwright and a Chromium."""

from __future__ import annotations

import shutil
import tempfile
import threading
from pathlib import Path

import uvicorn
from playwright.sync_api import sync_playwright

import aerotri
from aerotri.bench.places import places_of
from aerotri.bench.serve import ADDRESS, listening
from aerotri.bench.server import make_application, new_token
from aerotri.bench.session import Bench
from report import small

ROOT = Path(__file__).resolve().parents[2]
SITE, PICTURE = ROOT / "blocks" / "drone_site", ROOT / "docs" / "understand" / "figures" / "bench.png"
OPTIONS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
CHECK = ("K01", "K02", "K03")


def adjusted(place: Path) -> Path:
    """The folder of the result of the drone site."""
    tied = aerotri.tie_points(
        SITE / "photographs", control=SITE / "gcp_list.txt", check=CHECK, control_sigma_m=(0.01, 0.01, 0.02)
    )
    return aerotri.adjust(tied.block, parameters="auto").save(place / "drone_site_result", plots=False)


def photographed(address: str, picture: Path) -> None:
    """The worst ray, its point in all photographs."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=OPTIONS)
        context = browser.new_context(viewport={"width": 1500, "height": 950}, bypass_csp=True)
        page = context.new_page()
        page.goto(address)
        page.wait_for_selector("body[data-equations=ready]", timeout=120_000)
        page.click("#rays tbody tr:first-child")
        page.click("#tab-point")
        # the ground of the simulated photographs is dark
        page.evaluate("Object.assign(bench.photo, {brightness: 2.5, contrast: 1.3})")
        page.evaluate("bench.photo.bar(); bench.photo.surface.redraw()")
        page.evaluate("bench.showTab()")
        page.wait_for_timeout(3000)
        page.screenshot(path=str(picture))
        browser.close()


def main() -> None:
    with tempfile.TemporaryDirectory() as place, listening(0) as listener:
        bench = Bench(places_of(adjusted(Path(place))), SITE / "photographs")
        bench.wait()
        token = new_token()
        server = uvicorn.Server(uvicorn.Config(make_application(bench, token), log_level="error", lifespan="off"))
        threading.Thread(target=server.run, args=([listener],), daemon=True).start()
        shot = Path(place) / "shot.png"
        photographed(f"http://{ADDRESS}:{listener.getsockname()[1]}/{token}/", shot)
        small(shot, PICTURE)
        server.should_exit = True


if __name__ == "__main__":
    main()
