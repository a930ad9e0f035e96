"""crosscheck.json: what the comparison with other programs found, for machines.

    { "aerotri": "0.1.0", "block": "saar",
      "verdict": "agrees",                      // agrees | differs | parameters not checked | not checked
      "parameters_not_checked": [],             // what the verdict says nothing about: "collocation"
      "message": "agrees — …",                  // the verdict in a line
      "limits": {"sigma": 0.05, "vtpv": 1e-9, "covariance": 0.001, "patterns": 1e-9},
      "checks": [
        { "peer": "pycolmap",                   // pycolmap | independent model
          "question": "…",                      // what is compared
          "status": "agrees",                   // agrees | differs | not converged | not available
          "reason": "", "solver": "…", "iterations": 0, "seconds": 0, "observations": 0, "unknowns": 0,
          "vtpv": 0, "vtpv_peer": 0, "vtpv_difference": 0,             // relative, peer − ours
          "differences": [{"kind": "object points", "count": 0, "max": 0, "rms": 0, "worst": "Z 1007"}],   // |Δ|/σ
          "covariance": {"photographs": 0, "sigma": 0, "correlation": 0, "worst": ""},   // of the orientation, or null
          "patterns": {"count": 0, "max": 0, "worst": "bluh.1"},   // our formulas against the peer's, or null
          "notes": [""] } ] }

`max` and `rms` are null where the peer has no number for an unknown of the kind. In `covariance`, `sigma` is the
largest |σ_peer/σ_ours − 1| and `correlation` the largest difference of a correlation. In `patterns`, `max` is the
largest difference of a pattern over its largest value.
"""

from __future__ import annotations

from typing import Any

from aerotri.crosscheck.comparison import (
    COVARIANCE_LIMIT,
    LIMIT,
    PATTERN_LIMIT,
    VTPV_LIMIT,
    CrosscheckResult,
    PeerCheck,
)
from aerotri.formats.results.json_text import number_or_none


def crosscheck_json(result: CrosscheckResult) -> dict[str, Any]:
    """The content of crosscheck.json as plain Python values, without NaN."""
    return {
        "block": str(result.block),
        "verdict": result.verdict,
        "parameters_not_checked": list(result.unchecked),
        "message": result.sentence,
        "limits": {"sigma": LIMIT, "vtpv": VTPV_LIMIT, "covariance": COVARIANCE_LIMIT, "patterns": PATTERN_LIMIT},
        "checks": [_check(check) for check in result.checks],
    }


def _check(check: PeerCheck) -> dict[str, Any]:
    covariance, patterns = check.covariance, check.patterns
    return {
        "peer": check.peer,
        "question": check.question,
        "status": check.status,
        "reason": check.reason,
        "solver": check.solver,
        "iterations": int(check.iterations),
        "seconds": float(check.seconds),
        "observations": int(check.observations),
        "unknowns": int(check.unknowns),
        "vtpv": number_or_none(check.vtpv),
        "vtpv_peer": number_or_none(check.vtpv_peer),
        "vtpv_difference": number_or_none(check.vtpv_difference),
        "differences": [
            {
                "kind": d.kind,
                "count": d.count,
                "max": number_or_none(d.max),
                "rms": number_or_none(d.rms),
                "worst": str(d.worst),
            }
            for d in check.differences
        ],
        "covariance": None
        if covariance is None
        else {
            "photographs": covariance.photographs,
            "sigma": number_or_none(covariance.sigma),
            "correlation": number_or_none(covariance.correlation),
            "worst": covariance.worst,
        },
        "patterns": None
        if patterns is None
        else {"count": len(patterns.names), "max": number_or_none(patterns.max), "worst": patterns.worst},
        "notes": list(check.notes),
    }
