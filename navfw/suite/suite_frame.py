"""The runs of a suite as a pandas table: typed columns, comparison, plots, tables for papers."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from navfw.config.extras import extra_imports
from navfw.suite.paired_comparison import compare_tables, comparison_rows, pair_up
from navfw.suite.run_row import RunRow
from navfw.suite.suite_summary import brief_table, summarize

with extra_imports("pandas", key="navfw.load_suite"):
    import pandas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TYPES = {"str": "string", "int": "Int64", "float | None": "Float64", "int | None": "Int64"}
"""The type of a column by that of the field of a row; missing numbers are NA."""


class SuiteFrame(pandas.DataFrame):  # type: ignore[misc] # pandas has no types
    """One row per run, with the columns of ``navfw.suite.run_row.RunRow``, and ``succeeded``.

    Selected rows are a SuiteFrame again: ``runs[runs.family == "rooms"].compare(others)``.
    """

    @property
    def _constructor(self) -> Callable[..., SuiteFrame]:
        return SuiteFrame

    @classmethod
    def of(cls, rows: list[RunRow]) -> SuiteFrame:
        """Make the table of ``rows``."""
        columns = {
            field.name: pandas.array(
                [getattr(row, field.name) for row in rows], _TYPES[str(field.type)]
            )
            for field in dataclasses.fields(RunRow)
        }
        return cls({**columns, "succeeded": [row.succeeded for row in rows]})

    @property
    def rows(self) -> list[RunRow]:
        """The rows of the table as ``RunRow`` objects."""
        plain = self.drop(columns="succeeded").astype(object)
        records: list[dict[str, Any]] = plain.where(plain.notna(), None).to_dict("records")
        return [RunRow(**record) for record in records]

    def compare(self, other: SuiteFrame) -> pandas.DataFrame:
        """Compare run by run, B (``other``) minus A (this): success, SPL, time, collisions.

        ``attrs`` of the returned table has all that ``navfw report A B --json`` prints.

        Raises:
            InputError: no run is in both tables.

        """
        compared = compare_tables(self.rows, other.rows)
        table = pandas.DataFrame(comparison_rows(compared), columns=["", "A", "B", "B - A"])
        table.attrs = compared
        return table.set_index("")

    def plot_families(self, column: str = "spl") -> Axes:
        """Draw a box plot of a ``column`` per family, or per world if a run has no family."""
        group = "family" if (self["family"] != "").all() else "world"
        axes: Axes = self.astype({column: float}).boxplot(column=column, by=group)
        axes.figure.suptitle("")
        axes.set(title="", xlabel=group, ylabel=column)
        return axes

    def plot_pairs(self, other: SuiteFrame, column: str = "spl") -> Axes:
        """Draw a point per run in both tables: ``column`` here on x, of ``other`` on y.

        Raises:
            InputError: no run is in both tables.

        """
        import matplotlib.pyplot as plt

        sides = [(pair.a, pair.b) for pair in pair_up(self.rows, other.rows)]
        first, second = (
            [getattr(r, column) or 0.0 for r in side] for side in zip(*sides, strict=True)
        )
        axes = plt.subplots()[1]
        axes.scatter(first, second, s=12)
        axes.axline((0.0, 0.0), slope=1.0, color="gray", linewidth=0.8)
        axes.set(xlabel=f"{column} of A", ylabel=f"{column} of B")
        return axes

    def summary_markdown(self) -> str:
        """One row per entry or variant: success with its interval, collisions, SPL, time."""
        return brief_table(summarize(self.rows)).markdown()

    def summary_latex(self) -> str:
        """Return the table of ``summary_markdown`` as LaTeX; it needs the package booktabs."""
        return brief_table(summarize(self.rows)).latex()
