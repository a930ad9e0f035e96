"""Tables of the report about rolling shutters: how long they are read, and whether the block needs them."""

from __future__ import annotations

from aerotri.report.quality import printable
from aerotri.report.tables.adjustment import Column, Table
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.rolling_shutter import Readout

MODELS = {
    "none": "no rolling shutter", "affinity": "b1, b2 instead", "rolling shutter": "rolling shutter",
    "both": "b1, b2 besides",
}  # fmt: skip
FOUND = {"estimated": "free", "weighted": "observed", "fixed": "held"}
SOURCES = {"time": "times", "strip": "its strip", "speed": "stated speed", "unknown": "none"}


def readouts_table(adjusted: AdjustedBlock) -> Table:
    """Readout times of the cameras with their σ."""
    shutters = adjusted.rolling_shutters
    rows = [
        (
            printable(one.camera), float(one.readout_ms), float(one.sigma_ms), float(one.total_sigma_ms),
            FOUND[one.status], one.row_direction, one.photographs, float(one.speed_m_s), 1e3 * abs(one.moved_m),
            _sources(one),
        )
        for one in (() if shutters is None else shutters.readouts)
    ]  # fmt: skip
    columns = (
        Column("camera"), Column("readout", "ms", ".2f"), Column("σ", "ms", ".2f"), Column("total σ", "ms", ".2f"),
        Column("how"), Column("rows read"), Column("photographs", "", "d"), Column("speed", "m/s", ".1f"),
        Column("way", "mm", ".0f"), Column("velocities from"),
    )  # fmt: skip
    return Table("Rolling shutters", columns, tuple(rows))


def _sources(readout: Readout) -> str:
    said = ", ".join(f"{SOURCES[name]} {count}" for name, count in readout.velocities.items())
    return f"{said} (whole seconds)" if readout.time_rounding_s else said


def shutter_test_table(adjusted: AdjustedBlock) -> Table:
    """The block with each model of the effect."""
    shutters, rows = adjusted.rolling_shutters, []
    for one in () if shutters is None or shutters.test is None else shutters.test.variants:
        rows.append((
            MODELS[one.name], printable(one.status), float(one.sigma0), float(one.bic), float(one.readout_t),
            *(1e3 * float(value) for value in (*one.control_rms, *one.check_rms)),
        ))  # fmt: skip
    columns = [Column("model"), Column("adjustment"), Column("σ₀", "", ".3f"), Column("BIC", "", ".1f")]
    columns += [Column("|T|/σ", "", ".1f")]
    columns += [Column(f"{kind} {axis}", "mm", ".1f") for kind in ("control", "check") for axis in "XYZ"]
    return Table("Is the rolling shutter needed?", tuple(columns), tuple(rows))


def verdict(adjusted: AdjustedBlock) -> dict[str, str] | None:
    """A light and a sentence; None without a test."""
    shutters = adjusted.rolling_shutters
    if shutters is None or shutters.test is None:
        return None
    said = shutters.test.sentence
    level = "attention" if shutters.test.bends_heights else "good"
    return {"level": level, "sentence": printable(said[:1].upper() + said[1:] + ".", 1000)}
