"""One page about a whole run: its steps, their figures, and every step's own report or plots in it."""

from __future__ import annotations

import base64
import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import counted
from aerotri.coordinates.crs_names import heights_in_words
from aerotri.diagnosis.accuracy_rules import cm
from aerotri.diagnosis.purpose import beside_verdict
from aerotri.report.pages.dense import dense_parts
from aerotri.report.pages.head import page_environment, page_head
from aerotri.report.pages.ortho import ortho_parts
from aerotri.report.pages.product import FileText, ProductParts, only_shape, verdict_in_words
from aerotri.report.pages.volume import tonnes
from aerotri.report.quality import printable, two_digits
from aerotri.results.head import Head

RESULT = "result"
"""Folder of the adjustment."""
ON_SURFACE = {"volume": ", on the terrain (pickets)", "dsm_volume": ", on the dense surface"}
"""Folders of volumes, and what each was measured on, in words."""
LARGEST_PLOTS = 12
"""Plots of a step that has no report of its own."""
IN_PARTS = ("sigma_Z_m",)
"""Figures that consist of several."""
UNITS = {"m": "m", "m2": "m²", "m3": "m³", "px": "px", "um": "µm", "mm": "mm", "percent": "%"}
WORDS = {"sigma": "σ", "q90": "90 % below", "q95": "95 % below", "gsd": "GSD", "crs": "CRS", "max": "largest"}
"""Of keys, as the page writes them."""
LABELS = {
    "crs": "coordinate system, code", "crs_name": "coordinate system", "height_system": "system of heights",
    "ray_sigma_px": "σ of a matched image coordinate [px]",
    "sigma0_rays": "σ0 of the intersection of rays (1: as stated)",
    "interval_m": "distance of the points [m]", "interval_source": "distance of the points from",
    "ground_share": "share of the points that are ground", "ground_within": "all is ground within",
    "control": "control points", "check": "check points", "sigma_Z_m": "σ of heights [m]",
}  # fmt: skip
"""Of keys whose words alone do not say what they are."""
TECHNICAL = ("aerotri", "computed", "adjustment", "marking_page")
"""Keys that are for programs."""
PICTURES = (
    ("ortho", "orthophoto.png", "Orthophoto"),
    ("dsm", "surface.png", "Dense surface"),
    ("dsm", "colours.png", "Dense surface in the colours of the photographs"),
    ("volume", "thickness.png", "Volume: height over the base"),
)
"""What the page begins with: step, plot and caption."""
CAPTIONS = {
    "dtm": {
        "surface": "Terrain with objects, lit from the north-west, with contours.",
        "sigma": "σ of the heights. Dark is less sure.",
        "pickets": "Ground points (pickets): accepted, moved nearby, rejected; circles: holes.",
    }
}
"""Of the plots of steps that have no page of their own."""
PRODUCTS: Mapping[str, Callable[[Mapping[str, Any]], ProductParts]] = {"dsm": dense_parts, "ortho": ortho_parts}
"""Steps whose own pages consist of parts that stand on this one as well."""


def run_page(
    content: dict[str, Any], folder: Path, head: Head, files: Mapping[str, Sequence[FileText]] | None = None
) -> str:
    """The page as text; it loads nothing from elsewhere, and what the steps' pages hold cannot run scripts.

    Parameters
    ----------
    content : source, steps (name, folder, what, status, reason, seconds, arguments), seconds.
    folder : where the steps wrote. head : of the page. files : that steps wrote, by their names.
    """
    environment = page_environment()
    done = {step["folder"]: folder / step["folder"] for step in content["steps"] if step["status"] == "done"}
    named = {step["folder"]: step["name"] for step in content["steps"]}
    shown = _pictures(done)
    steps = [_step(step, folder / step["folder"], set(shown)) for step in content["steps"]]
    for step in steps:
        step["files"] = (files or {}).get(step["name"], ())
    template = environment.get_template("run.html.j2")
    adjusted = _read(folder / RESULT / "adjustment.json")
    return template.render(
        source=printable(Path(content["source"]).name or content["source"]),
        seconds=content["seconds"], steps=steps, verdict=_verdict(adjusted),
        doubts=_doubts([(named[at], place) for at, place in done.items()]),
        results=_results({name: _read(place / f"{named[name]}.json") for name, place in done.items()}),
        pictures=list(shown.values()), head=page_head(head),
    )  # fmt: skip


def _doubts(done: Sequence[tuple[str, Path]]) -> dict[str, str]:
    """What is to be known of surface and orthophoto first, and of which of them; the verdict has its own place.

    What their own pages begin with comes before the rest.
    """
    found: dict[str, list[str]] = {}
    rank: dict[str, int] = {}
    for name, place in done:
        parts = _parts_of(name, place)
        if parts is None:
            continue
        content = _read(place / f"{name}.json")
        elsewhere = {*verdict_in_words(content), only_shape(content)}
        for number, text in enumerate(one for one in parts.doubts if one not in elsewhere):
            found.setdefault(text, []).append(parts.kind)
            rank.setdefault(text, number)
    return {text: " and ".join(found[text]).capitalize() for text in sorted(found, key=rank.__getitem__)}


def _pictures(done: Mapping[str, Path]) -> dict[Path, tuple[str, str, str]]:
    """Caption, content and name of the plots that the page begins with, by their files."""
    places = [(done[name] / "plots" / plot, caption) for name, plot, caption in PICTURES if name in done]
    return {place: (caption, _address(place), place.stem) for place, caption in places if place.is_file()}


def _address(path: Path) -> str:
    """A picture inside the page, as a data address."""
    return f"data:image/png;base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"


def _read(path: Path) -> dict[str, Any]:
    """The content of a JSON file, {} where there is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _verdict(adjusted: Mapping[str, Any]) -> tuple[str, list[str], str, str]:
    """The verdict on the adjustment, '' where there is none, its reasons, what it is good for, and a word on that."""
    reasons = [printable(str(reason), 1000) for reason in adjusted.get("reasons", [])]
    purpose = printable(str(adjusted.get("purpose", "")), 1000)
    verdict = str(adjusted.get("verdict", ""))
    return verdict, reasons, purpose, beside_verdict(verdict, str(adjusted.get("good_for", "")))


def _results(of_step: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str]]:
    """What was measured and how sure it is, a line each; of_step : what steps wrote, by their folders."""
    found = []
    if accuracy := of_step.get("accuracy"):
        found += _accuracy(accuracy)
    measured = [(on, volume) for name, on in ON_SURFACE.items() if (volume := of_step.get(name))]
    for on, volume in measured:
        found += _volume(volume, on if len(measured) > 1 else "")
    if surface := of_step.get("dsm"):
        sigma = surface["sigma_Z_m"]
        text = f"cells of {surface['cell_m']:.3g} m; σ of heights {two_digits(sigma['median'])} m (median)"
        found.append(("Dense surface", text + _left(sigma.get("relative"))))
    if image := of_step.get("ortho"):
        total = image["sigma_m"]["total"]
        text = f"cells of {image['cell_m']:g} m; σ of positions {two_digits(total['median'])} m (median), 95 % below "
        left = (image["sigma_m"].get("relative") or {}).get("median")
        found.append(("Orthophoto", f"{text}{two_digits(total['q95'])} m{_left(left)}"))
    return found


def _left(sigma: float | None) -> str:
    """The σ of the shape behind that in the coordinate system; '' where it is not known."""
    return "" if sigma is None else f"; relative, for shape and volumes, {two_digits(sigma)} m"


def _volume(volume: Mapping[str, Any], on: str) -> list[tuple[str, str]]:
    """Volumes and masses; on : which surface, where there are several."""
    piles = volume.get("piles") or []
    found = [(f"Volume of {printable(str(one['name']))}, net{on}", _net(one, one["sigma_m3"])) for one in piles]
    name = "Volume of all piles, net" if piles else "Volume, net"
    found.append((f"{name}{on}", _net(volume, (volume.get("sigma") or {}).get("sigma_m3"))))
    if mass := volume.get("mass"):
        text = f"{tonnes(mass)} t at {mass['density_t_per_m3']:g} t/m³"
        found.append((f"Mass of all piles, net{on}" if piles else f"Mass, net{on}", text))
    return found


def _net(volume: Mapping[str, Any], sigma: float | None) -> str:
    """A volume with its σ."""
    text = f"{volume['net_m3']:.{_places(sigma)}f} m³"
    return f"{text} ± {sigma:.{_places(sigma)}f} m³ (1 σ)" if sigma else f"{text}, without σ"


def _accuracy(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    """RMSE at the check points, and what the standard says to them."""
    known = {"RMSE_H": "in plan", "RMSE_V": "in height", "VVA": "in height in vegetation"}
    numbers = [f"{name} {cm(value)} {text}" for name, text in known.items()
               if (value := content["accuracy"].get(name)) is not None]  # fmt: skip
    said = {"met": "all that is required is met", "not met": "NOT all that is required is met",
            "cannot be said": "part of what is required cannot be said"}  # fmt: skip
    included = ", survey error included" if numbers else ""
    words = f"{', '.join(numbers)}{included}, at {counted(content['check_points'], 'check point')}"
    return [("Accuracy", f"{words}; ASPRS edition 2: {said[content['met']]}")]


def _places(sigma: float | None) -> int:
    """Decimals that show two digits of a σ."""
    return 1 if not sigma else int(np.clip(1 - np.floor(np.log10(sigma)), 0, 6))


def _step(step: dict[str, Any], folder: Path, shown: set[Path]) -> dict[str, Any]:
    done = step["status"] == "done"
    places = (folder / name for name in ("report.html", "accuracy.html", "volume.html"))
    pages = [place for place in places if done and place.is_file()]
    page = pages[0].read_text(encoding="utf-8") if pages else ""
    parts = _parts_of(step["name"], folder) if done else None
    captions = parts.captions if parts else CAPTIONS.get(step["name"], {})
    there = _in_order(folder / "plots", list(captions)) if done and not page else []
    plots = [plot for plot in there if plot not in shown][:LARGEST_PLOTS]
    return {
        **step,
        "reason": printable(step["reason"], 1000),
        "command": printable(shlex.join(("aerotri", *step["arguments"])), 1000),
        "parts": parts,
        "figures": _figures(folder) if done and not parts else [],
        "page": page,
        "file": f"{step['folder']}/{pages[0].name}" if pages else "",
        "plots": [(captions.get(one.stem, one.stem.replace("_", " ")), _address(one), one.stem) for one in plots],
        "marking": done and (folder / "control_marks" / "marking.html").is_file(),
    }


def _parts_of(name: str, folder: Path) -> ProductParts | None:
    """What the own page of a step says, without its pictures; None for steps that have none of this kind.

    Files of a version that did not say how good the adjustment is have no such page either.
    """
    content = _read(folder / f"{name}.json") if name in PRODUCTS else {}
    return PRODUCTS[name](content) if "adjusted" in content else None


def _in_order(folder: Path, names: list[str]) -> list[Path]:
    """The plots of a step, those that are named first, in their order."""
    there = sorted(folder.glob("*.png"))
    return sorted(there, key=lambda one: names.index(one.stem) if one.stem in names else len(names))


def _figures(folder: Path) -> list[tuple[str, str]]:
    """Numbers, texts and sentences at the top of the JSON files of a step, in their own words."""
    found = []
    for path in sorted(folder.glob("*.json")):
        content = _read(path)
        shown = {key: value for key, value in content.items() if _is_plain(value) and key not in TECHNICAL}
        if shown.get("height_system") == "":
            shown["height_system"] = heights_in_words(str(shown.get("crs", "")))
        found += [(_worded(key), _text(value)) for key, value in shown.items()]
        for key in IN_PARTS:
            if isinstance(content.get(key), dict):
                found += _parts(_worded(key), content[key])
        said = [*content.get("messages", []), *content.get("notes", [])]
        found += [("", printable(text, 1000)) for text in said if isinstance(text, str)]
    # import.json and tiepoints.json begin with the same
    return list(dict.fromkeys(found))


def _worded(key: str) -> str:
    """'sigma_m' → 'σ [m]', 'q95' → '95 % below'."""
    if key in LABELS:
        return LABELS[key]
    words = key.split("_")
    unit = UNITS.get(words[-1], "") if len(words) > 1 else ""
    text = " ".join(WORDS.get(word, word) for word in (words[:-1] if unit else words))
    return f"{text} [{unit}]" if unit else text


def _parts(name: str, value: Any) -> list[tuple[str, str]]:
    """Numbers within others, each by the names that lead to it."""
    if isinstance(value, dict):
        return [one for key, part in value.items() for one in _parts(f"{name}: {_worded(key)}", part)]
    return [(name, _text(value))] if _is_plain(value) else []


def _is_plain(value: Any) -> bool:
    return isinstance(value, int | float | str) and value != ""


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"
    return printable(str(value), 300)
