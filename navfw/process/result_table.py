"""Tables of results: titles of columns, and how values are formatted.

``navfw.cli.output.print_tables`` prints a table on a terminal, ``ResultTable.markdown`` formats it
for files and pages.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


def shown(value: object, form: str = "", unit: str = "", missing: str = "-") -> str:
    """Format a value by a format specification, with a ``unit`` after it.

    ``missing`` is the text for None and for numbers that are not finite.

    >>> shown(0.1234, ".1%"), shown(12.34, ".1f", "s"), shown(None)
    ('12.3 %', '12.3 s', '-')
    """
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return missing
    text = format(value, form)
    if form.endswith("%"):
        text = text.replace("%", " %")
    return f"{text} {unit}" if unit else text


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its title, the value of a record, and the format of the value (see ``shown``).

    ``value`` is a key of the records, or a function of a record.
    """

    title: str
    value: str | Callable[[Any], object]
    form: str = ""
    unit: str = ""
    missing: str = "-"

    def cell(self, record: Any) -> str:
        """Return the text in this column for a record."""
        value = self.value(record) if callable(self.value) else record[self.value]
        return shown(value, self.form, self.unit, self.missing)


@dataclass(frozen=True, slots=True)
class ResultTable:
    """A table with a row for each of its records; ``title`` says what it shows."""

    title: str
    columns: Sequence[Column]
    records: Sequence[Any]

    @property
    def head(self) -> list[str]:
        """The titles of the columns."""
        return [column.title for column in self.columns]

    @property
    def rows(self) -> list[list[str]]:
        """The texts of the cells, (records, columns)."""
        return [[column.cell(record) for column in self.columns] for record in self.records]

    def markdown(self) -> str:
        """Return the table in Markdown, without its title."""
        return markdown_table(self.head, self.rows)

    def latex(self) -> str:
        """Return the table as a LaTeX tabular; it needs the package booktabs."""
        columns = "l" + "r" * (len(self.columns) - 1)
        lines = [" & ".join(map(_in_latex, row)) + r" \\" for row in (self.head, *self.rows)]
        parts = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", lines[0], r"\midrule", *lines[1:]]
        return "\n".join([*parts, r"\bottomrule", r"\end{tabular}", ""])


def named(records: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Convert ``records`` by name to a list, with the name of each under the key ``name``."""
    return [{"name": name, **record} for name, record in records.items()]


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; all columns but the first are aligned to the right."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |\n" for row in lines
    )


def _in_latex(cell: str) -> str:
    """``cell`` with LaTeX's special characters escaped, and "<" and brackets kept as they are."""
    escaped = re.sub(r"([&%$#_{}])", r"\\\1", cell).replace("<", "$<$")
    return f"{{{escaped}}}" if escaped.startswith("[") else escaped
