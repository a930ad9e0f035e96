"""One self-contained page about a volume: the number, its σ, the budget, the map, the sections."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import floor, log10
from pathlib import Path
from typing import Any

from aerotri.diagnosis.purpose import PER_VOLUME
from aerotri.formats.results.volume import beyond_of_side, boundary_in_words, sigma_of_side
from aerotri.report.pages.adjustment import data_address
from aerotri.report.pages.head import page_environment, page_head, settings_rows
from aerotri.report.pages.product import only_shape
from aerotri.report.plots.rendering import RenderedPlot
from aerotri.report.quality import printable, two_digits, with_sigma
from aerotri.results.head import Head
from aerotri.volume.accuracy import BRIDGED, LASTING, MODEL

CAPTIONS = {
    "budget": (
        "One standard deviation of each part alone, and of all together. The part of the adjustment holds the "
        "correlation between all heights; it is found by one solution with the factor of the normal equations."
    ),
    "thickness": "Height of the surface over the base: brown is cut (above), blue and hatched is fill (below).",
    "section_areas": "Areas of the cross sections. The rule (trapezoidal or Simpson's) says what lies between them.",
    "section_profiles": "Three of the sections; their places are broken lines on the map.",
}


def volume_html(content: Mapping[str, Any], plots: Mapping[str, RenderedPlot], head: Head) -> str:
    """The page as text.

    Parameters
    ----------
    content : of volume.json. plots : by the names of `CAPTIONS`, in the order of the page.
    head : of the page.
    """
    environment = page_environment()
    return environment.get_template("volume.html.j2").render(
        name=printable(content["dtm"]), base=printable(content["base"]["name"]),
        boundary=printable(boundary_in_words(content["boundary"])), head=page_head(head),
        cards=_cards(content),
        warnings=[printable(text, 1000) for text in content["warnings"]], budget=_budget(content),
        methods=_methods(content), settings=settings_rows(content), piles=_piles(content), mass=_mass_words(content),
        plots=[{"name": name, "source": data_address(plot), "caption": CAPTIONS[name]}
               for name, plot in plots.items()],
    )  # fmt: skip


def write_volume_page(content: Mapping[str, Any], plots: Mapping[str, RenderedPlot], path: Path, head: Head) -> None:
    """Write the page; arguments as in `volume_html`."""
    path.write_text(volume_html(content, plots, head), encoding="utf-8")


def _number(value: float) -> str:
    """Without decimals from a hundred on, else with two."""
    text = f"{value:,.0f}" if abs(value) >= 100.0 else f"{value:.2f}"
    return text.replace(",", "\u2009").replace("-", "−")


def _cards(c: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    s = c["sigma"]
    net = _number(c["net_m3"]) if s is None else with_sigma(c["net_m3"], s["sigma_m3"])
    return [
        ("Net", f"{net} m³", "cut less fill" + ("" if s is None else ", one standard deviation")),
        ("Cut", _side(c, "cut") + " m³", f"above the base, on {_number(c['cut_area_m2'])} m²"),
        ("Fill", _side(c, "fill") + " m³", f"below the base, on {_number(c['fill_area_m2'])} m²"),
        ("Area", _number(c["boundary"]["area_m2"]) + " m²", f"{_number(c['no_data_area_m2'])} m² of it not known"),
    ]


def _side(c: Mapping[str, Any], name: str) -> str:
    """Cut or fill, with its σ where it is known."""
    return _with(c[f"{name}_m3"], sigma_of_side(c, name))


def _with(value: float, sigma: float | None) -> str:
    return _number(value) if sigma is None else with_sigma(value, sigma)


def _budget(c: Mapping[str, Any]) -> str:
    """The σ in words."""
    s = c["sigma"]
    if s is None:
        return ""
    largest = max(s["parts_m3"], key=s["parts_m3"].get)
    shared = {
        MODEL: "image errors that photographs share",
        LASTING: "matching errors that neighbouring cells share",
        BRIDGED: "ground that is bridged below objects",
    }
    largest = shared.get(largest, largest)
    known, wide = two_digits(s["sigma_m3"]), two_digits(1.96 * s["sigma_m3"])
    text = (
        f"The volume is known to {known} m³ (1 σ; 95 %: ± {wide} m³), as if the mean height were known to "
        f"{two_digits(1e3 * s['sigma_mean_height_m'])} mm. The largest part is that of the {largest}. {s['pickets']} "
        f"heights with {s['rays']} rays went into it."
    )
    text += _of_the_whole(c)
    bent = s["curvature"]
    if bent is not None:
        held, side = ("cut hills off", "more") if bent["value_m3"] >= 0.0 else ("fill hollows", "less")
        text += (
            f" Straight lines between the heights {held}: the ground is expected to hold "
            f"{with_sigma(abs(bent['value_m3']), bent['sigma_m3'])} m³ {side}. The volume is that of the surface as "
            "given, so this is not in it; its σ counts it as ground between the points."
        )
    beyond = [beyond_of_side(c, name) for name in ("cut", "fill")]
    if beyond[0] is not None and beyond[1] is not None:
        text += (
            f" The base cuts the ground: the true cut is expected to be {_more(beyond[0], s['sigma_m3'])} and the true "
            f"fill {_more(beyond[1], s['sigma_m3'])} than the surface shows. This is not in them; their σ counts it."
        )
    if not s["systematic"]["variants"]:
        return text + " No image errors were estimated, so what they do to the volume is not known."
    return text


def _of_the_whole(c: Mapping[str, Any]) -> str:
    """What errors of the whole block do to the volume; '' in files of versions that did not say so."""
    a = c.get("adjusted")
    if not a:
        return ""
    text = " σ comes from the whole covariance of the adjustment, so that it contains what matters for a volume: "
    text += (
        "the base follows from the surface, and a shift or a tilt of the whole block cancels."
        if c["base"].get("follows_surface")
        else "errors of the whole block count as far as the base does not move with them."
    )
    if a["scale"] is not None:
        length, volume = (two_digits(100.0 * share * a["scale"]) for share in (1.0, PER_VOLUME))
        text += f" The scale of the block is known to ± {length} %, which is ± {volume} % of a volume; σ contains this."
    shape = only_shape(c)
    return f"{text} The adjustment: {shape}" if shape else text


def _more(value: float, sigma: float) -> str:
    """A volume by which the truth is larger or smaller, to the digits of σ."""
    amount = with_sigma(abs(value), sigma).partition(" ±")[0]
    return f"{amount} m³ {'more' if value >= 0.0 else 'less'}"


def _piles(c: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Rows of the table of piles, the last one all together."""
    if not c["piles"]:
        return []
    s = c["sigma"]
    sigma = None if s is None else s["sigma_m3"]
    whole: dict[str, Any] = {**c, "name": "all together", "area_m2": c["boundary"]["area_m2"], "sigma_m3": sigma}
    whole |= {f"sigma_{of}_m3": sigma_of_side(c, of) for of in ("cut", "fill")}
    return [
        (printable(one["name"]), _number(one["area_m2"]), _with(one["cut_m3"], one.get("sigma_cut_m3")),
         _with(one["fill_m3"], one.get("sigma_fill_m3")), _with(one["net_m3"], one["sigma_m3"]),
         tonnes(one["mass"]))
        for one in (*c["piles"], whole)
    ]  # fmt: skip


def tonnes(mass: Mapping[str, Any] | None) -> str:
    """t with their σ; '' where no density was stated."""
    if mass is None:
        return ""
    return _number(mass["net_t"]) if mass["sigma_t"] is None else with_sigma(mass["net_t"], mass["sigma_t"])


def _mass_words(c: Mapping[str, Any]) -> str:
    """The tonnes in a sentence."""
    mass = c["mass"]
    if mass is None:
        return ""
    known = f" ± {mass['s_density_t_per_m3']:g}" if mass["s_density_t_per_m3"] else ""
    sure = "; its σ counts that of the volume and of the density" if mass["sigma_t"] is not None else ""
    return f"At {mass['density_t_per_m3']:g}{known} t/m³ the net volume has a mass of {tonnes(mass)} t{sure}."


def _methods(c: Mapping[str, Any]) -> list[tuple[str, ...]]:
    net, cut, fill = (_like(c, name) for name in ("net", "cut", "fill"))
    return [
        (m["method"], net(m["net_m3"]), cut(m["cut_m3"]), fill(m["fill_m3"]), _number(m["no_data_area_m2"]), m["note"])
        for m in c["methods"]
    ]


def _like(c: Mapping[str, Any], name: str) -> Callable[[float], str]:
    """How the volumes of other methods are written: to the digits of the one that counts, else their differences are
    lost; without σ to six digits, a litre at least."""
    sigma = (c["sigma"] or {}).get("sigma_m3") if name == "net" else sigma_of_side(c, name)
    if sigma:
        return lambda value: with_sigma(value, sigma).partition(" ±")[0]
    largest = max(abs(m[f"{name}_m3"]) for m in c["methods"])
    digits = min(max(0 if largest <= 0.0 else 5 - floor(log10(largest)), 0), 3)
    return lambda value: f"{value:,.{digits}f}".replace(",", "\u2009").replace("-", "−")
