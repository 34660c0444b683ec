"""The report as a sentence in the paper's words (Tables 2 and 3, METHOD R13)."""

from __future__ import annotations

from collections.abc import Mapping

from navfw.offis.nearness import TERMS
from navfw.offis.pyramid import position


def report(
    obstacles: Mapping[str, Mapping[str, str]], front: str, floor_in_front: bool, known: bool
) -> str:
    """One sentence of parts joined by "; ".

    Layer 1 names all quadrants of the nearest object with one distance, the deeper layers name the
    distance per quadrant: "Layer1: nearest object is on upper right and on upper left in middle
    distance; Layer2: nearest object is on upper right in middle distance and on upper left in
    middle distance; Front is a door; Floor in front". ``known`` is false if all regions are
    unknown.
    """
    parts = []
    for number, regions in enumerate(obstacles.values(), start=1):
        if not known:
            parts.append(f"Layer{number}: nearest object is unknown")
        elif not regions:
            parts.append(f"Layer{number}: no object in sight")
        else:
            parts.append(f"Layer{number}: nearest object is {_location(number, regions)}")
    parts.append("Front is unknown" if front == "unknown" else f"Front is a {front}")
    if floor_in_front:
        parts.append("Floor in front")
    return "; ".join(parts)


def _location(layer: int, regions: Mapping[str, str]) -> str:
    nearest: dict[str, str] = {}
    for region, term in regions.items():
        place = position(region)
        if place not in nearest or TERMS.index(term) < TERMS.index(nearest[place]):
            nearest[place] = term
    if layer == 1:
        term = min(nearest.values(), key=TERMS.index)
        return f"{' and '.join(f'on {place}' for place in nearest)} in {term} distance"
    return " and ".join(f"on {place} in {term} distance" for place, term in nearest.items())
