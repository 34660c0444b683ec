"""Membership functions, hedges, and the sampled universes on which they are evaluated.

scikit-fuzzy represents a membership function by its samples on the variable's universe, and
interpolates linearly between them. navfw does the same. Corners of triangles and trapezoids are
samples, so that their sampled form is exact.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from navfw.numerics import Array
from navfw.numerics.functions import exp

_EDGE_WIDTH = 1e-9  # chosen
"""Width of the ramp that represents a vertical edge, relative to the range of the variable."""

_SAME = 1e-13  # chosen
"""Distance, relative to the range of the variable, below which two samples count as one."""

MAX_SIZE = 1e12  # derived
"""Largest magnitude of numbers in rules, and of a bound over the width of its range."""


class Shape(ABC):
    """A membership function: crisp values in, degrees in [0, 1] out (arrays of the same shape)."""

    @abstractmethod
    def __call__(self, x: Array) -> Array:
        """Compute the exact degree of membership of each ``x``."""

    @property
    @abstractmethod
    def corners(self) -> tuple[float, ...]:
        """Values of x where the slope changes: samples there make the sampled form exact."""

    @property
    def jumps(self) -> tuple[tuple[float, int], ...]:
        """Vertical edges as (x, side): -1 for a rise at x, +1 for a fall right after x."""
        return ()

    @property
    def knots(self) -> tuple[float, ...]:
        """Further samples of a curved function that make linear interpolation accurate."""
        return ()


@dataclass(frozen=True)
class Trapezoid(Shape):
    """Zero up to a, one from b to c, zero from d; ``places`` are a <= b <= c <= d, else ValueError.

    A triangle has three places, b = c. Equal places make a vertical edge.
    """

    places: tuple[float, ...]

    def __post_init__(self) -> None:
        if not all(left <= right for left, right in pairwise(self.places)):
            count = "three" if len(self.places) == 3 else "four"
            order = " <= ".join("abcd"[: len(self.places)])
            raise ValueError(f"expected {count} corners {order}")

    def __call__(self, x: Array) -> Array:
        """Compute the degrees, linear between the corners; 1 at a vertical edge."""
        (a, b), (c, d) = self.places[:2], self.places[-2:]
        y = np.ones_like(x)
        rising = (x < b) & (x > a)
        falling = (x > c) & (x < d)
        y[rising] = (x[rising] - a) / (b - a)
        y[falling] = (d - x[falling]) / (d - c)
        # zero outside; at a vertical edge the corner itself has degree 1
        y[((x <= a) & (x < b)) | ((x >= d) & (x > c))] = 0.0
        return y

    @property
    def corners(self) -> tuple[float, ...]:
        """All ``places``."""
        return self.places

    @property
    def jumps(self) -> tuple[tuple[float, int], ...]:
        """Vertical edges: a rise at b if a = b, a fall after c if c = d."""
        (a, b), (c, d) = self.places[:2], self.places[-2:]
        return (((b, -1),) if a == b else ()) + (((c, 1),) if c == d else ())


@dataclass(frozen=True, slots=True)
class Gauss(Shape):
    """exp(-(x - mean)^2 / (2 sigma^2)), sigma > 0."""

    mean: float
    sigma: float

    def __post_init__(self) -> None:
        if not self.sigma > 0:
            raise ValueError("expected mean and sigma with sigma > 0")

    def __call__(self, x: Array) -> Array:
        """Compute the degrees: one at the mean; zero (by underflow) beyond some 38 sigma."""
        z = (x - self.mean) / self.sigma
        return np.asarray(exp(-0.5 * np.square(np.clip(z, -1e3, 1e3))))

    @property
    def corners(self) -> tuple[float, ...]:
        """The mean, so that the sampled form reaches one."""
        return (self.mean,)

    @property
    def knots(self) -> tuple[float, ...]:
        """Samples at multiples of sigma / 4, up to four sigma on each side."""
        return tuple(self.mean + self.sigma * z for z in np.linspace(-4.0, 4.0, 33).tolist())


@dataclass(frozen=True, slots=True)
class Sigmoid(Shape):
    """1 / (1 + exp(-slope (x - centre))): rising for slope > 0, falling for slope < 0."""

    centre: float
    slope: float

    def __post_init__(self) -> None:
        if self.slope == 0:
            raise ValueError("expected centre and slope with slope not 0")

    def __call__(self, x: Array) -> Array:
        """Compute the degrees: 0.5 at the centre."""
        z = self.slope * (x - self.centre)
        return np.asarray(1.0 / (1.0 + exp(np.clip(-z, -700.0, 700.0))))

    @property
    def corners(self) -> tuple[float, ...]:
        """The centre, so that the sampled form is 0.5 there."""
        return (self.centre,)

    @property
    def knots(self) -> tuple[float, ...]:
        """Samples at multiples of 0.5 / slope, up to 8 / slope on each side."""
        return tuple(self.centre + z / self.slope for z in np.linspace(-8.0, 8.0, 33).tolist())


@dataclass(frozen=True, slots=True)
class Points(Shape):
    """Linear between ``degrees`` at increasing ``places``, constant outside; else ValueError."""

    places: tuple[float, ...]
    degrees: tuple[float, ...]

    def __post_init__(self) -> None:
        increasing = all(left < right for left, right in pairwise(self.places))
        within = all(0.0 <= degree <= 1.0 for degree in self.degrees)
        if not len(self.places) == len(self.degrees) >= 2 or not increasing or not within:
            raise ValueError("expected pairs of x, which increase, and a degree from 0 to 1")

    def __call__(self, x: Array) -> Array:
        """Compute the degrees."""
        return np.asarray(np.interp(x, self.places, self.degrees))

    @property
    def corners(self) -> tuple[float, ...]:
        """All ``places``."""
        return self.places


SHAPES: dict[str, tuple[Callable[..., Shape], tuple[str, ...]]] = {
    "triangle": (lambda *places: Trapezoid(places), ("a", "b", "c")),
    "trapezoid": (lambda *places: Trapezoid(places), ("a", "b", "c", "d")),
    "gauss": (Gauss, ("mean", "sigma")),
    "sigmoid": (Sigmoid, ("centre", "slope")),
    "points": (lambda *pairs: Points(pairs[::2], pairs[1::2]), ()),
}
"""Makers of shapes by their name in rule files, with the names of their parameters in order; ():
any number of them."""


def make_shape(kind: str, parameters: Sequence[float]) -> Shape:
    """Make the shape ``kind`` (a key of ``SHAPES``, which names its parameters).

    Raises:
        ValueError: wrong number of parameters, beyond ``MAX_SIZE``, or out of order.

    """
    shape, names = SHAPES[kind]
    if names and len(parameters) != len(names):
        raise ValueError(
            f"expected {len(names)} numbers [{', '.join(names)}], got {len(parameters)}"
        )
    if not all(abs(value) <= MAX_SIZE for value in parameters):
        raise ValueError(f"expected numbers of at most {MAX_SIZE:g}, got {list(parameters)}")
    try:
        return shape(*(float(value) for value in parameters))
    except ValueError as error:
        raise ValueError(f"{error}, got {list(parameters)}") from None


HEDGES: dict[str, Callable[[Array], Array]] = {"very": np.square, "somewhat": np.sqrt}
"""Zadeh's hedges, written before a term, as functions of its degree."""


def hedged(degree: Array, hedges: Iterable[str]) -> Array:
    """Apply ``hedges`` to ``degree``; the hedge next to the term acts first."""
    for hedge in reversed(tuple(hedges)):
        degree = HEDGES[hedge](degree)
    return degree


def sample_universe(low: float, high: float, points: int, shapes: Iterable[Shape]) -> Array:
    """Make increasing samples of [low, high]: ``points`` even ones and those that ``shapes`` need.

    A vertical edge at x gets a second sample beside it, at 1e-9 of the range, so that it stays
    almost vertical under linear interpolation.
    """
    shapes = tuple(shapes)
    width = high - low
    exact = {low, high}
    for shape in shapes:
        exact.update(x for x in shape.corners if low <= x <= high)
        beside = (x + side * _EDGE_WIDTH * width for x, side in shape.jumps)
        exact.update(x for x in beside if low < x < high)
    kept = [low]
    for x in sorted(exact)[1:]:
        if x - kept[-1] > _SAME * width:
            kept.append(x)
    kept[-1] = high
    even = np.linspace(low, high, points)
    knots = [x for shape in shapes for x in shape.knots if low < x < high]
    return _merge(np.array(kept), np.union1d(even, knots), 1e-6 * width)


def _merge(kept: Array, extra: Array, gap: float) -> Array:
    """Return ``kept``, and the values of ``extra`` farther than ``gap`` from all of ``kept``."""
    after = np.searchsorted(kept, extra)
    left = np.abs(extra - kept[np.maximum(after - 1, 0)])
    right = np.abs(kept[np.minimum(after, kept.size - 1)] - extra)
    return np.union1d(kept, extra[np.minimum(left, right) > gap])
