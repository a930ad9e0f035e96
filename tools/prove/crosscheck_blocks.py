"""The cross-check of the real blocks and the sample block, as a Markdown table.

Example
-------
    python tools/prove/crosscheck_blocks.py
    python tools/prove/crosscheck_blocks.py blocks/frederiksstad_ultracam ../shared/data/dbat_roma
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import aerotri

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
BLOCKS = (DATA / "dbat_sxb", DATA / "dbat_roma", ROOT / "blocks" / "frederiksstad_ultracam")
HEAD = ("block", "peer", "kind", "count", "largest Δ/σ", "RMS Δ/σ", "outcome")


def main() -> None:
    """Check every block and print the table; exit 1 when one differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("blocks", nargs="*", type=Path, default=list(BLOCKS), help="default: Strasbourg, roma, sample")
    rows: list[tuple[str, ...]] = []
    agrees = True
    for path in parser.parse_args().blocks:
        if not path.exists():
            print(f"{path} is not there, left out", file=sys.stderr)
            continue
        result, seconds = _check(path)
        agrees &= result.verdict == "agrees"
        rows += _rows(result)
        print(f"{result.block}: {result.sentence} ({seconds:.0f} s)", file=sys.stderr)
    for cells in (HEAD, ("---",) * len(HEAD), *rows):
        print("| " + " | ".join(cells) + " |")
    raise SystemExit(0 if agrees and rows else 1)


def _check(path: Path):
    begun = time.perf_counter()
    return aerotri.crosscheck(path).record, time.perf_counter() - begun


def _rows(result) -> list[tuple[str, ...]]:
    rows = []
    for check in result.checks:
        known = (result.block, check.peer)
        if not check.solver:
            rows.append((*known, check.reason, "", "", "", check.status))
            continue
        for d in check.differences:
            rows.append((*known, d.kind, str(d.count), f"{d.max:.1e}", f"{d.rms:.1e}", check.status))
        if check.covariance is not None:
            count, size = str(check.covariance.photographs), f"{check.covariance.sigma:.1e} relative"
            rows.append((*known, "σ of the orientation", count, size, "", check.status))
        rows.append((*known, "vᵀPv", "", f"{check.vtpv_difference:+.0e} relative", "", check.status))
    return rows


if __name__ == "__main__":
    main()
