"""The verbs of a run replaced by ones that tell what they were called with, and end as they are told."""

from __future__ import annotations

import json
from types import SimpleNamespace

from aerotri.observations.project import Project

VERBS = {
    "tie_points": "aerotri.public.tying.tie_points", "adjust": "aerotri.public.adjusting.adjust_folder",
    "terrain": "aerotri.public.terrain.terrain", "volume": "aerotri.public.volume.volume",
    "dense": "aerotri.public.dense.dense_surface", "orthophoto": "aerotri.public.ortho.orthophoto",
}  # fmt: skip


class Fakes:
    """Records of the calls, and what is to happen instead of success: an exception, or a verdict of the adjustment."""

    def __init__(self, monkeypatch):
        self.called, self.ends = [], {}
        for verb, place in VERBS.items():
            monkeypatch.setattr(place, lambda *given, verb=verb, **settings: self._call(verb, given, settings))

    def _call(self, verb, given, settings):
        settings.pop("progress")
        self.called.append((verb, tuple(map(str, given)), settings))
        end = self.ends.get(verb)
        if isinstance(end, Exception):
            raise end
        return adjusted(end or "accepted") if verb == "adjust" else Saved()

    @property
    def verbs(self):
        return [verb for verb, _, _ in self.called]


class FakeBlock(str):
    """A block that is only its name."""

    project = Project()
    crs = "local"


class Saved:
    """What a verb gives that is written by itself."""

    notes = ()
    block = FakeBlock("a block")
    misplaced = ""

    def save(self, out, *given, **settings):
        out.mkdir(parents=True, exist_ok=True)
        (out / "tiepoints.json").write_text('{"messages": ["<script>x</script>"], "rays": 12}')

    def html(self):
        return "<p>saved</p>"

    def _repr_html_(self):
        return self.html()


def adjusted(verdict, status="converged", check=()):
    outcome = SimpleNamespace(verdict=verdict, status=status, reasons=("σ₀ is 522",), message="")
    return SimpleNamespace(
        verdict=verdict, status=status, block=FakeBlock("adjusted"), notes=(), reasons=outcome.reasons,
        adjusted=SimpleNamespace(outcome=outcome, check=check), html=lambda: "<p>adjusted</p>",
    )  # fmt: skip


def ends_of(folder):
    """How the steps of a run ended, as written."""
    steps = json.loads((folder / "run.json").read_text(encoding="utf-8"))["steps"]
    twice = {"dsm_volume"}
    return {
        step["folder"] if step["folder"] in twice else step["name"]: (step["status"], step["reason"]) for step in steps
    }
