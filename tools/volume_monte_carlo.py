"""Is the stated σ of a volume its scatter? Simulated blocks with self-calibration, pickets measured in them.

Every source of error alone, then all together: Σz² over the runs against the 99.9 % band of χ², z = error / stated σ.
Prints a Markdown table; with --out writes volume_monte_carlo.md there. The last answer stands in
tools/results/volume_monte_carlo.md.

Example: python tools/volume_monte_carlo.py --runs 200 --out results
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from volume_proof.simulated import ALL, PARTS, Run, make_site, run

HEADER = """| source of error | runs | scatter (RMS error), m³ | stated σ (RMS), m³ | mean z | Σz² | 99.9 % band | |
|---|---|---|---|---|---|---|---|"""


def row(name: str, runs: list[Run]) -> str:
    """A line of the table."""
    error, sigma = np.array([r.error for r in runs]), np.array([r.sigma for r in runs])
    z = error / sigma
    low, high = chi2.ppf([0.0005, 0.9995], len(runs))
    total = float(np.sum(z**2))
    verdict = "inside" if low <= total <= high else "OUTSIDE"
    return (
        f"| {name} | {len(runs)} | {np.sqrt(np.mean(error**2)):.0f} | {np.sqrt(np.mean(sigma**2)):.0f} | "
        f"{np.mean(z):+.2f} | {total:.1f} | {low:.1f} … {high:.1f} | {verdict} |"
    )


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    site = make_site()
    lines = [f"# σ of a volume against its scatter, {site.boundary.area:.0f} m² over a hill", "", *HEADER.split("\n")]
    print("\n".join(lines), flush=True)
    for name, on in (*((part, frozenset([part])) for part in PARTS), ("all together", ALL)):
        lines.append(row(name, [run(site, seed, on) for seed in range(1, options.runs + 1)]))
        print(lines[-1], flush=True)
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "volume_monte_carlo.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
