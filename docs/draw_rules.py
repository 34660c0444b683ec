"""Draw the membership functions of shipped rule bases, for ``docs/rules.md`` and ``behaviors.md``.

Each input and output of a rule base is one plot: the degree of each of its terms over its range.
Run it after a change of these rules::

    uv run python docs/draw_rules.py
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from navfw.config.lookup import shipped_folder
from navfw.fuzzy import RuleBase, Variable, load_rule_base

DOCS = Path(__file__).parent
DRAWN = ("go_to_xy", "avoid")
"""The rule bases that are drawn."""

WIDTH, HEIGHT = 9.6, 1.7
"""Width of a picture, and height of a row of plots [inch]."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#555555", "#8c564b")
"""Of the terms of a variable, of Okabe and Ito, and two more."""


def draw_variable(axes: Axes, variable: Variable, role: str) -> None:
    """Draw the terms of ``variable``, an input or output (``role``), each named at its middle."""
    universe = variable.universe
    for number, (name, term) in enumerate(variable.terms.items()):
        degrees = term(universe)
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(universe, degrees, color=colour, linewidth=1.6)
        middle = float(universe[degrees >= degrees.max() - 1e-9].mean())
        above = 1.04 + 0.15 * (number % 3)
        axes.text(middle, above, name, color=colour, fontsize=6.5, ha="center", va="bottom")
    axes.set(title=f"{variable.name} ({role})", ylim=(0.0, 1.6), yticks=(0.0, 0.5, 1.0))
    axes.set_xlim(float(universe[0]), float(universe[-1]))
    axes.title.set_fontsize(8.5)
    axes.tick_params(labelsize=7)
    axes.spines[["top", "right"]].set_visible(False)


def draw_rule_base(base: RuleBase) -> Figure:
    """Draw all inputs and outputs of ``base``."""
    variables = [(one, "input") for one in base.inputs.values()]
    variables += [(one, "output") for one in base.outputs.values()]
    columns = 2 if len(variables) <= 4 else 3
    rows = -(-len(variables) // columns)
    figure = Figure(figsize=(WIDTH, HEIGHT * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, (variable, role) in zip(grid, variables, strict=False):
        draw_variable(axes, variable, role)
    for axes in grid[len(variables) :]:
        axes.set_visible(False)
    return figure


def picture_of(name: str) -> Path:
    """The file of the picture of a rule base."""
    return DOCS / "images" / f"rules-{name.replace('_', '-')}.png"


def main() -> None:
    """Draw all pictures."""
    for name in DRAWN:
        base = load_rule_base(shipped_folder() / "behaviors" / f"{name}.yaml")
        draw_rule_base(base).savefig(picture_of(name), dpi=110)


if __name__ == "__main__":
    main()
