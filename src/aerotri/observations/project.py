"""Who a block belongs to and what it is for."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True)
class Project:
    """What `[project]` of block.toml says; '' where nothing is given.

    Parameters
    ----------
    title : of the project.
    client : who ordered the work.
    operator : who computes.
    company : of the operator.
    survey_date : day of the survey, YYYY-MM-DD.
    notes : anything else that belongs on the report.
    """

    title: str = ""
    client: str = ""
    operator: str = ""
    company: str = ""
    survey_date: str = ""
    notes: str = ""

    def as_dict(self) -> dict[str, str]:
        """All entries by name."""
        return {one.name: str(getattr(self, one.name)) for one in fields(self)}

    def given(self) -> dict[str, str]:
        """The entries that say something, by name."""
        return {name: text for name, text in self.as_dict().items() if text}
