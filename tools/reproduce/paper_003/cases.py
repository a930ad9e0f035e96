"""The blocks and sets of paper 003 (Spreckels, Schlienkamp, Jacobsen 2007) and the numbers it prints."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

BLOCKS = Path(__file__).parents[3] / "blocks"


@dataclass(frozen=True)
class Case:
    """A block with the sets it is adjusted with.

    Parameters
    ----------
    name : folder under blocks/. title : in words.
    figures : numbers in the paper of averaged residuals and of systematic image errors, 0 for none.
    sets : (heading, parameters) in the order of the tables; the first is none, the last the paper's whole set.
    special : the camera's own parameters, '' for film.
    """

    name: str
    title: str
    figures: tuple[int, int]
    sets: tuple[tuple[str, str], ...]
    special: str

    @property
    def plan_path(self) -> Path:
        """Of simulation.toml."""
        return BLOCKS / self.name / "simulation.toml"


@dataclass(frozen=True)
class Printed:
    """What the paper says of a block after its best adjustment; None where it says nothing.

    Parameters
    ----------
    sigma0_um, sigma0_px; check_px : of X and Y; check_m, check_z_m. note : where it stands.
    """

    sigma0_um: float | None
    sigma0_px: float | None
    check_px: float | None
    check_m: float | None
    check_z_m: float | None
    note: str


def _sets(special: str) -> tuple[tuple[str, str], ...]:
    numbers = special.partition(":")[2].replace("+", ", ").replace("-", "–")
    return (("none", "none"), ("1–12", "bluh:1-12"), (numbers, special), (f"1–12, {numbers}", f"bluh:1-12,{special}"))


ULTRACAM, DMC = "ultracam_d:42-73", "dmc:30-41+74-77"
DSK = Case("dsk_saar_ultracam", "DSK-Saar, UltraCamD no. 8", (9, 10), _sets(ULTRACAM), ULTRACAM)
FREDERIKSSTAD = (
    Case("frederiksstad_ultracam", "Frederiksstad, UltraCamD no. 2", (12, 13), _sets(ULTRACAM), ULTRACAM),
    Case("frederiksstad_dmc", "Frederiksstad, DMC", (14, 15),
         (*_sets(DMC), ("1–12, 79, 80", "bluh:1-12,dmc:79+80")), DMC),
    Case("frederiksstad_rmk", "Frederiksstad, RMK TOP 15", (0, 0), _sets("")[:2], ""),
)  # fmt: skip

PRINTED = {
    "dsk_saar_ultracam": Printed(2.3, 0.25, 0.34, 0.031, 0.054, "5.1, 6.1"),
    # 12.4 cm is printed; .20 px of x-parallax at 60 % end lap are 12.8 cm
    "frederiksstad_ultracam": Printed(None, 0.25, 0.31, None, 0.124, "5.2, 7"),
    "frederiksstad_dmc": Printed(None, 0.15, 0.25, None, None, "7, all DMC blocks"),
    "frederiksstad_rmk": Printed(None, None, None, None, None, ""),
}
PRINTED_T80 = 20.3
"""[P] 5.3: "the parameter 80 has a T-test value of 20.3"."""
PRINTED_H_B = (
    ("UltraCamD", 101.4, 67.5, 0.663, 4.4),
    ("UltraCamD", 101.4, 67.5, 0.495, 2.9),
    ("UltraCamD", 101.4, 67.5, 0.84, 9.3),
)
"""[P] figures 16–18: camera, focal length mm, format along the flight mm, end lap, h/b as printed."""
