"""`aerotri volume`: a volume, how sure it is, and the page about it."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.commands.console import Console, written
from aerotri.conventions import InputError, in_digits, real_path
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder
from aerotri.volume.settings import LAYER, SIGMA

if TYPE_CHECKING:
    from aerotri.volume.settings import BoundaryFrom, Layer, Method, SectionPlan, SigmaOptions


@dataclass(frozen=True)
class VolumeInput:
    """What to compute, as on the command line."""

    surface: Path
    base: str
    boundary: str | None
    method: Method
    adjustment: Path | None
    pickets: Path | None
    base_adjustment: Path | None
    base_pickets: Path | None = None
    layer: Layer = LAYER
    density: float | None = None
    density_sigma: float = 0.0
    project: Path | None = None
    boundary_from: BoundaryFrom = SIGMA.boundary_from

    def check(self) -> None:
        """Refuse what does not go together, in the words of the command line.

        Raises
        ------
        InputError
        """
        from aerotri.public.volume import is_surface

        if self.adjustment is None and (self.pickets or self.base_adjustment or self.base_pickets):
            raise InputError(
                "--pickets, --base-pickets and --base-adjustment belong to --adjustment", "give the adjustment"
            )
        if self.adjustment is None and self.boundary_from != SIGMA.boundary_from:
            raise InputError(
                f"--boundary-from {self.boundary_from} belongs to --adjustment",
                "give the adjustment that the surface was measured with: without σ it has no effect",
            )
        if self.density is None and self.density_sigma > 0.0:
            raise InputError("--density-sigma belongs to --density", "give the density, tonnes per cubic metre")
        if not is_surface(self.base) and (self.base_adjustment is not None or self.base_pickets is not None):
            raise InputError("--base-adjustment and --base-pickets need a surface as base", "give its raster as --base")


def run_volume(
    given: VolumeInput, plan: SectionPlan, sigma_options: SigmaOptions, out: Path | None, plots: bool, as_json: bool
) -> int:
    """Exit code of the command; arguments as on the command line."""
    from aerotri.compiled import compilation_notice
    from aerotri.deformation.absorbed import AbsorptionFailedError
    from aerotri.formats.files.atomic import room_beside
    from aerotri.public.volume import volume
    from aerotri.public.volume_result import RECORD

    console, s = Console(quiet=as_json), sigma_options
    given.check()
    target = out or Path(f"{real_path(given.surface).stem}_volume")
    refuse_foreign_folder(target, RECORD)
    console.progress(compilation_notice())
    try:
        with room_beside(target) as room:
            found = volume(
                given.surface, given.boundary, layer=given.layer, base=given.base, method=given.method,
                section_spacing=plan.spacing, azimuth=plan.azimuth, adjustment=given.adjustment, pickets=given.pickets,
                base_adjustment=given.base_adjustment, base_pickets=given.base_pickets,
                matching_sigma_um=s.matching_sigma_um, matching_window=s.matching_window_m, base_sigma=s.base_sigma,
                boundary_sigma=s.boundary_sigma, boundary_from=s.boundary_from, corrected=s.corrected,
                density=given.density, density_sigma=given.density_sigma, project=given.project, scratch=room,
                progress=console.stage,
            )  # fmt: skip
            if plots:
                console.progress("plots")
            found.save(target, plots)
    except AbsorptionFailedError as failure:
        console.failure(str(failure))
        return 1
    for note in found.notes:
        console.note(note)
    if as_json:
        print(json_text(found.summary))
    else:
        console.lines(outcome_lines(found.summary, target))
    return 0


def outcome_lines(content: dict[str, Any], target: Path) -> list[str]:
    """What the user reads of the volume."""
    from aerotri.deformation.restitution import ORIENTED
    from aerotri.formats.results.volume import boundary_in_words
    from aerotri.report.quality import with_sigma

    c, s = content, content["sigma"]
    whole = _Whole.of(c)
    net = whole.told(c["net_m3"], None if s is None else s["sigma_m3"])
    cut, fill = (whole.side(c, name) for name in ("cut", "fill"))
    lines = [
        f"net {net}{'' if s is None else ' (1 σ)'}: cut {cut}, fill {fill}; {c['method']}, over {c['base']['name']}, "
        f"{in_digits(c['boundary']['area_m2'], 6)} m² inside {boundary_in_words(c['boundary'])}"
    ]
    lines += [_pile_line(pile, whole) for pile in c["piles"]]
    if c["mass"] is not None:
        lines.append(f"mass: {_tonnes(c['mass'])} at {c['mass']['density_t_per_m3']:g} t/m³")
    if s is not None:
        lines.append("σ by part, m³: " + ", ".join(f"{name} {in_digits(v, 4)}" for name, v in s["parts_m3"].items()))
        lines += _beyond(c, whole)
        where = "in the volume:" if s["systematic"]["in_the_volume"] else "corrected; uncorrected they would add"
        for one in s["systematic"]["variants"]:
            added = with_sigma(one["value_m3"], one["sigma_m3"], signed=True)
            lines.append(f"systematic image errors, {ORIENTED[one['variant']]}: {where} {added} m³")
    lines += [f"  {one['method']:<24} net {in_digits(one['net_m3'], 6)} m³" for one in c["methods"]]
    return [*lines, *(f"note: {text}" for text in c["warnings"]), written(target, "volume.html")]


@dataclass(frozen=True)
class _Whole:
    """How volumes without σ are told: all with the decimals of the largest, to six digits, a litre at least."""

    decimals: int

    @classmethod
    def of(cls, content: dict[str, Any]) -> _Whole:
        largest = max(abs(content[f"{name}_m3"]) for name in ("net", "cut", "fill"))
        digits = 5 if largest <= 0.0 else 5 - floor(log10(largest))
        return cls(min(max(digits, 0), 3))

    def side(self, content: dict[str, Any], name: str) -> str:
        """The cut or the fill."""
        from aerotri.formats.results.volume import sigma_of_side

        return self.told(content[f"{name}_m3"], sigma_of_side(content, name))

    def told(self, value: float, sigma: float | None) -> str:
        """m³, to two digits of σ where there is one."""
        from aerotri.report.quality import with_sigma

        plain = f"{value:.{self.decimals}f}".replace("-", "−")
        return f"{plain} m³" if sigma is None else f"{with_sigma(value, sigma)} m³"


def _beyond(content: dict[str, Any], whole: _Whole) -> list[str]:
    """What straight lines between the heights leave out."""
    from aerotri.formats.results.volume import beyond_of_side
    from aerotri.report.quality import with_sigma

    held = [(name, beyond_of_side(content, name)) for name in ("cut", "fill")]
    told = [f"{name} {whole.told(value, None)}" for name, value in held if value is not None]
    bent = content["sigma"]["curvature"]
    if bent is not None:
        told.append(f"net {with_sigma(bent['value_m3'], bent['sigma_m3'], signed=True)} m³")
    if not told:
        return []
    return [f"terrain between the measured points (estimated, not added): {', '.join(told)}; its error is counted in σ"]


def _pile_line(pile: dict[str, Any], whole: _Whole) -> str:
    mass = "" if pile["mass"] is None else f", {_tonnes(pile['mass'])}"
    cut, fill = (whole.told(pile[f"{name}_m3"], pile.get(f"sigma_{name}_m3")) for name in ("cut", "fill"))
    return (
        f"  {pile['name']}: net {whole.told(pile['net_m3'], pile['sigma_m3'])}, cut {cut}, fill {fill}, "
        f"on {in_digits(pile['area_m2'], 6)} m²{mass}"
    )


def _tonnes(mass: dict[str, Any]) -> str:
    from aerotri.report.quality import with_sigma

    stated = mass["stated_sigma_t"]
    alone = "" if stated is None else f" (± {in_digits(stated, 4)} t by what is stated alone)"
    sure = in_digits(mass["net_t"], 6) if mass["sigma_t"] is None else with_sigma(mass["net_t"], mass["sigma_t"])
    return f"{sure} t{alone}"
