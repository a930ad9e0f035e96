"""A volume as a notebook sees it: numbers, σ, tables, plots, and a folder to keep it in."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import FilePath, InputError, in_digits
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.surfaces import Surface
from aerotri.public.table import Table
from aerotri.results.head import Head

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.formats.files.spool import Spool
    from aerotri.volume.boundary import Boundary
    from aerotri.volume.compute import Volumes
    from aerotri.volume.sections import Profile
    from aerotri.volume.thickness import ThicknessMap

RECORD, THICKNESS = "volume.json", "thickness.tif"
OWN_NAMES = (RECORD, THICKNESS, "sections.csv", "piles.csv", "plots", "volume.html")
ALL_PILES = "all together"
NO_SIGMA = "the volume has no σ", "give the adjustment that the surface was measured with"


@dataclass(frozen=True, eq=False)
class VolumePlots:
    """Plots of a volume, each a matplotlib Figure.

    Parameters
    ----------
    volumes : by every method. boundary : of the volume. summary : content of volume.json.
    map : the thickness, coarse. profiles : sections to draw.
    """

    volumes: Volumes
    boundary: Boundary
    summary: dict[str, Any]
    map: ThicknessMap
    profiles: list[Profile]

    def thickness(self) -> Figure:
        """Map of cut and fill."""
        from aerotri.report.plots.volume import plot_thickness

        return plot_thickness(self.map, self.boundary, self.volumes, self.summary)

    def budget(self) -> Figure:
        """The parts of σ.

        Raises
        ------
        InputError
            For a volume without an adjustment, which has no σ.
        """
        from aerotri.report.plots.volume import plot_budget

        if self.summary["sigma"] is None:
            raise InputError(*NO_SIGMA)
        return plot_budget(self.summary)

    def section_areas(self) -> Figure:
        """Areas of the cross sections."""
        from aerotri.report.plots.volume import plot_section_areas

        return plot_section_areas(self.volumes.sections, self.summary["dtm"])

    def section_profiles(self) -> Figure:
        """Surface and base along three of the sections."""
        from aerotri.report.plots.volume import plot_section_profiles

        return plot_section_profiles(self.profiles, self.summary["dtm"])

    def all(self) -> dict[str, Figure]:
        """Every plot of the page by the name of its file."""
        budget = {} if self.summary["sigma"] is None else {"budget": self.budget()}
        return {
            "thickness": self.thickness(), **budget, "section_areas": self.section_areas(),
            "section_profiles": self.section_profiles(),
        }  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredVolume:
    """What `aerotri.volume` returns: cut, fill and net, σ with its parts, sections and a map.

    Parameters
    ----------
    record : the volumes by every method, as records.
    boundary : of the volume.
    summary : content of volume.json.
    map : the thickness, coarse. profiles : sections to draw.
    spool : holds the raster of the thickness until it is saved.
    notes : doubts about the adjustments, in sentences. head : of page and file.
    """

    record: Volumes
    boundary: Boundary
    summary: dict[str, Any]
    map: ThicknessMap
    profiles: list[Profile]
    spool: Spool
    notes: tuple[str, ...] = ()
    head: Head = field(default_factory=Head)

    @property
    def net(self) -> float:
        """m³, cut less fill."""
        return self.record.chosen.net

    @property
    def cut(self) -> float:
        """m³ above the base."""
        return self.record.chosen.cut

    @property
    def fill(self) -> float:
        """m³ below the base."""
        return self.record.chosen.fill

    @property
    def area(self) -> float:
        """m², inside the boundary."""
        return self.boundary.area

    @property
    def sigma(self) -> float | None:
        """m³, one standard deviation of net; None without an adjustment."""
        return None if self.summary["sigma"] is None else self.summary["sigma"]["sigma_m3"]

    @property
    def cut_sigma(self) -> float | None:
        """m³, one standard deviation of cut; None without an adjustment."""
        from aerotri.formats.results.volume import sigma_of_side

        return sigma_of_side(self.summary, "cut")

    @property
    def fill_sigma(self) -> float | None:
        """m³, one standard deviation of fill; None without an adjustment."""
        from aerotri.formats.results.volume import sigma_of_side

        return sigma_of_side(self.summary, "fill")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What else the user should read, in sentences."""
        return tuple(self.summary["warnings"])

    @cached_property
    def parts(self) -> Table:
        """The parts of σ, each alone, m³: adjustment, its model part if any, matching, interpolation, base, boundary.

        Raises
        ------
        InputError
            For a volume without an adjustment, which has no σ.
        """
        if self.summary["sigma"] is None:
            raise InputError(*NO_SIGMA)
        parts = self.summary["sigma"]["parts_m3"]
        return _table("parts of σ", {"part": list(parts), "sigma_m3": list(parts.values())}, {"sigma_m3": "m³"})

    @cached_property
    def methods(self) -> Table:
        """The volume by every method, m³ and m²."""
        rows = self.summary["methods"]
        units = {name: "m³" if name.endswith("m3") else "m²" for name in rows[0] if name not in ("method", "note")}
        return _table("methods", {name: [row[name] for row in rows] for name in rows[0]}, units)

    @cached_property
    def sections(self) -> Table:
        """The cross sections: the columns of sections.csv; m and m²."""
        s = self.record.sections
        names = ("cut_area_m2", "fill_area_m2", "cut_length_m", "fill_length_m", "no_data_length_m")
        columns = {"station_m": s.station, **{name: s.sums[:, k] for k, name in enumerate(names)}}
        return _table("sections", columns, {name: "m²" if name.endswith("m2") else "m" for name in columns})

    @cached_property
    def piles(self) -> Table:
        """Every polygon of the boundary, and the last row all together: the columns of piles.csv; m², m³ and t.

        Empty where the boundary is one polygon; σ is NaN without an adjustment, tonnes without a density.
        """
        s = self.summary
        rows = [*s["piles"], _of_all(s)] if s["piles"] else []
        names = (
            "area_m2", "cut_m3", "sigma_cut_m3", "fill_m3", "sigma_fill_m3", "net_m3", "sigma_m3", "no_data_area_m2",
        )  # fmt: skip
        columns: dict[str, Any] = {"name": [row["name"] for row in rows]}
        columns |= {name: [_known(row[name]) for row in rows] for name in names}
        masses = [row["mass"] or {} for row in rows]
        columns |= {name: [_known(mass.get(name)) for mass in masses] for name in ("net_t", "sigma_t")}
        return _table("piles", columns, {name: PILE_UNITS[name[name.rindex("_") :]] for name in columns if "_" in name})

    @property
    def thickness(self) -> Surface:
        """Surface less base inside the boundary, a raster on disk as long as it is in use."""
        return Surface(self.spool.folder / THICKNESS, keeper=self.spool)

    @property
    def plot(self) -> VolumePlots:
        """Plots, each a matplotlib Figure."""
        return VolumePlots(self.record, self.boundary, self.summary, self.map, self.profiles)

    def save(self, out: FilePath, plots: bool = True) -> Path:
        """Write volume.json, the raster of the thickness, the sections, the plots and the page into a folder.

        Parameters
        ----------
        out : folder; an older result there is replaced in one step. plots : draw the plots and the page.

        Returns
        -------
        Path of the folder.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        target = Path(out)
        refuse_foreign_folder(target, RECORD)
        _write(target, self, plots)
        return target

    def __repr__(self) -> str:
        sure = "" if self.sigma is None else f" ± {in_digits(self.sigma, 4)}"
        return f"<aerotri volume of {self.summary['dtm']!r}: net {in_digits(self.net, 6)}{sure} m³>"

    def _repr_html_(self) -> str:
        return self.html()

    def html(self) -> str:
        """The volume, as a notebook shows it."""
        from aerotri.formats.results.volume import boundary_in_words

        s = self.summary
        sure = "" if self.sigma is None else f" ± {in_digits(self.sigma, 4)} (1 σ)"
        warnings = "".join(f"<li>{escape(text)}</li>" for text in self.warnings)
        parts = "" if self.sigma is None else self.parts.html()
        parts = (self.piles.html() if s["piles"] else "") + parts
        return (
            f"<div><b>{escape(s['dtm'])}: net {in_digits(self.net, 6)} m³{sure}</b>, cut {in_digits(self.cut, 6)}"
            f"{_sure(self.cut_sigma)}, fill {in_digits(self.fill, 6)}{_sure(self.fill_sigma)} m³ "
            f"over {escape(s['base']['name'])}, {in_digits(self.area, 6)} m² inside "
            f"{escape(boundary_in_words(s['boundary']))}"
            f"{f'<ul>{warnings}</ul>' if warnings else ''}{parts}</div>"
        )


PILE_UNITS = {"_m2": "m²", "_m3": "m³", "_t": "t"}


def _of_all(summary: dict[str, Any]) -> dict[str, Any]:
    """The sum of the piles, as one of them."""
    sigma = None if summary["sigma"] is None else summary["sigma"]["sigma_m3"]
    from aerotri.formats.results.volume import sigma_of_side

    sides = {f"sigma_{name}_m3": sigma_of_side(summary, name) for name in ("cut", "fill")}
    return summary | sides | {"name": ALL_PILES, "area_m2": summary["boundary"]["area_m2"], "sigma_m3": sigma}


def _sure(sigma: float | None) -> str:
    return "" if sigma is None else f" ± {in_digits(sigma, 4)}"


def _known(value: float | None) -> float:
    return float("nan") if value is None else value


def _table(name: str, columns: dict[str, Any], units: dict[str, str]) -> Table:
    import pyarrow as pa

    return Table(name, pa.table(columns), units)


def _write(target: Path, found: MeasuredVolume, plots: bool) -> None:
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.results.json_text import write_json
    from aerotri.public.tables import write_rows

    with atomic_folder(target, own=OWN_NAMES) as folder:
        found.spool.give(THICKNESS, folder / THICKNESS)
        write_rows(found.sections, folder / "sections.csv")
        if found.summary["piles"]:
            write_rows(found.piles, folder / "piles.csv")
        if plots:
            from aerotri.report.documents.picture_texts import save_translated
            from aerotri.report.pages.volume import write_volume_page
            from aerotri.report.plots.rendering import save_plots

            drawn = save_plots(found.plot.all(), folder / "plots")
            save_translated("thickness", found.plot.thickness, folder / "plots")
            write_volume_page(found.summary, drawn, folder / "volume.html", found.head)
        write_json(folder / RECORD, found.summary)
