"""Recordings made here, with labels of some of their frames."""

from __future__ import annotations

from pathlib import Path

from perceive_images import save, texture, wall_at

from navfw.bench import FrameLabel

EVERYWHERE = "upper_left upper_right lower_left lower_right"


def label(
    nearest: str = "upper_left",
    also: str = "",
    floor: str = "yes",
    front: str = "corridor",
    front_also: str = "",
    file: str = "image_3.png",
    folder: str = "approach",
) -> FrameLabel:
    """A label of the tuning split."""
    return FrameLabel(
        part=f"{folder}, a",
        split="tuning",
        folder=folder,
        file=file,
        single=False,
        nearest=frozenset(nearest.split()),
        nearest_also=frozenset(also.split()),
        floor_in_front=floor,
        front=front,
        front_also=frozenset(front_also.split()),
    )


def save_approach(data: Path, folder: str = "approach") -> list[FrameLabel]:
    """Write an approach to a wall to a ``folder`` of ``data``; labels for two of its frames."""
    picture = texture()
    save(data / folder, [wall_at(2.05 - 0.05 * k, picture) for k in range(1, 6)])
    return [
        label(EVERYWHERE, floor="no", front="wall", file=f"image_{k}.png", folder=folder)
        for k in (3, 5)
    ]
