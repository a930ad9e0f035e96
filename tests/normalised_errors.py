"""What errors over σ of many simulated blocks have to be."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import chi2


def assert_normal(runs: Sequence[tuple[Mapping[str, float], float, float]], case: str) -> None:
    """Errors over σ N(0, 1), each unknown by itself, and σ0² 1, to 99.9 %.

    Parameters
    ----------
    runs : of every block the errors over σ by their names, vᵀPv, and the redundancy. case : for the message.
    """
    n = len(runs)
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    for name in runs[0][0]:
        z = np.array([run[0][name] for run in runs])
        assert abs(z.mean()) < 3.3 / np.sqrt(n), f"{case}: {name} is biased, mean z {z.mean():.2f}"
        assert low < np.mean(z**2) < high, f"{case}: σ of {name} is wrong, mean z² {np.mean(z**2):.2f}"
    total, redundancy = sum(run[1] for run in runs), sum(run[2] for run in runs)
    low, high = chi2.ppf([0.0005, 0.9995], redundancy) / redundancy
    assert low < total / redundancy < high, f"{case}: σ0² = {total / redundancy:.4f}"
