"""What is known of an unknown beforehand."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Prior:
    """What is known of an unknown beforehand: its value, and whether it is held, observed with σ, or free."""

    value: float = 0.0
    sigma: float | None = None
    fixed: bool = False

    @property
    def kind(self) -> str:
        """'fixed', 'weighted' or 'free'."""
        if self.fixed:
            return "fixed"
        return "free" if self.sigma is None else "weighted"
