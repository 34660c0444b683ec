"""Draw the pictures that furniture, doors and walls of the shipped worlds show.

    uv run python docs/draw_pictures.py

Each is a JPEG in ``worlds/pictures``, drawn from rectangles and noise; the same at every call.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

PICTURES = Path(__file__).parents[1] / "worlds" / "pictures"
Colour = tuple[int, ...]
"""Red, green and blue."""

WHITE, PALE, GREY, DARK = (236, 234, 228), (206, 205, 200), (140, 143, 146), (52, 54, 58)
OAK, WALNUT, STEEL = (196, 152, 100), (112, 78, 52), (168, 174, 180)
RED, BLUE, GREEN, SAND = (158, 62, 54), (66, 92, 138), (86, 120, 84), (205, 188, 155)


class Canvas:
    """A picture of ``size`` (width, height) [m] at 6 mm a pixel, (0, 0) at the upper left."""

    def __init__(self, size: tuple[float, float], ground: Colour, grain: float = 5.0) -> None:
        self.width, self.height = size
        self._scale = 1000.0 / 6.0
        shape = (round(self.height * self._scale), round(self.width * self._scale), 3)
        self.image = np.full(shape, ground, np.float32)
        self._rng = np.random.default_rng(round(1000 * self.width + self.height * 77) + sum(ground))
        self._grain = grain

    def _span(self, x: float, y: float, wide: float, high: float) -> tuple[slice, slice]:
        rows = slice(round(y * self._scale), round((y + high) * self._scale))
        return rows, slice(round(x * self._scale), round((x + wide) * self._scale))

    def fill(self, x: float, y: float, wide: float, high: float, colour: Colour) -> None:
        """A rectangle [m]."""
        self.image[self._span(x, y, wide, high)] = colour

    def shade(self, x: float, y: float, wide: float, high: float, top: float, foot: float) -> None:
        """Multiply a rectangle [m] by a gradient from top to foot."""
        part = self.image[self._span(x, y, wide, high)]
        part *= np.linspace(top, foot, len(part), dtype=np.float32)[:, None, None]

    def panel(self, x: float, y: float, wide: float, high: float, colour: Colour) -> None:
        """A rectangle [m] with a bright upper and a dark lower edge, in a dark gap."""
        gap, edge = 0.012, 0.014
        self.fill(x, y, wide, high, DARK)
        x, y, wide, high = x + gap / 2, y + gap / 2, wide - gap, high - gap
        self.fill(x, y, wide, high, colour)
        self.shade(x, y, wide, high, 1.06, 0.94)
        self.shade(x, y, wide, edge, 1.16, 1.16)
        self.shade(x, y + high - edge, wide, edge, 0.7, 0.7)

    def grain(self, along: float, across: float, strength: float) -> None:
        """Multiply by noise with these correlation lengths [m]."""
        noise = self._rng.standard_normal(self.image.shape[:2]).astype(np.float32)
        sigma = across * self._scale, along * self._scale
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), sigma[1], sigmaY=sigma[0]), np.float32)
        self.image *= 1.0 + strength * (noise / noise.std())[..., None]

    def finished(self) -> np.ndarray:
        """The picture (height, width, 3), RGB."""
        self.grain(0.012, 0.012, 0.01 * self._grain)
        return np.clip(np.rint(self.image), 0, 255).astype(np.uint8)


def drawers(columns: int, rows: int, ground: Colour, size: tuple[float, float]) -> np.ndarray:
    """Drawers with handles between a worktop and a plinth."""
    canvas = Canvas(size, ground)
    canvas.grain(0.25, 0.012, 0.05)
    base = canvas.image.copy()
    wide, high = canvas.width / columns, (canvas.height - 0.12) / rows
    for column in range(columns):
        for row in range(rows):
            x, y = column * wide, 0.04 + row * high
            canvas.panel(x, y, wide, high, ground)
            canvas.fill(x + wide / 2 - 0.07, y + 0.06, 0.14, 0.022, DARK)
            canvas.shade(x + wide / 2 - 0.07, y + 0.085, 0.14, 0.02, 0.8, 0.9)
    canvas.image *= base / base.mean(axis=(0, 1))
    canvas.fill(0, 0, canvas.width, 0.04, tuple(int(min(1.15 * c, 250)) for c in ground))
    canvas.shade(0, 0.04, canvas.width, 0.03, 0.6, 1.0)
    canvas.fill(0, canvas.height - 0.08, canvas.width, 0.08, DARK)
    return canvas.finished()


def cupboard(leaves: int, ground: Colour, size: tuple[float, float], top: Colour) -> np.ndarray:
    """Tall doors with handles below a worktop."""
    canvas = Canvas(size, ground)
    wide = canvas.width / leaves
    for leaf in range(leaves):
        canvas.panel(leaf * wide, 0.04, wide, canvas.height - 0.12, ground)
        at = (leaf + 1) * wide - 0.07 if leaf % 2 == 0 else leaf * wide + 0.04
        middle = 0.16 if canvas.height < 1.2 else 0.45 * canvas.height
        canvas.fill(at, middle, 0.025, 0.16, DARK)
    canvas.fill(0, 0, canvas.width, 0.045, top)
    canvas.shade(0, 0.045, canvas.width, 0.03, 0.6, 1.0)
    canvas.fill(0, canvas.height - 0.08, canvas.width, 0.08, DARK)
    return canvas.finished()


def desk() -> np.ndarray:
    """A desk: a pedestal at each end, dark between them, a modesty panel behind."""
    canvas = Canvas((1.6, 0.75), (70, 60, 50))
    canvas.fill(0.5, 0.1, 0.62, 0.4, (120, 96, 70))
    canvas.shade(0.5, 0.1, 0.62, 0.65, 0.75, 0.35)
    for x in (0.02, 1.13):
        for row in range(3):
            canvas.panel(x, 0.05 + 0.21 * row, 0.45, 0.21, OAK)
            canvas.fill(x + 0.15, 0.12 + 0.21 * row, 0.15, 0.02, DARK)
    canvas.grain(0.2, 0.015, 0.04)
    canvas.fill(0, 0, 1.6, 0.045, (214, 172, 120))
    canvas.shade(0, 0.045, 1.6, 0.05, 0.5, 1.0)
    return canvas.finished()


def table() -> np.ndarray:
    """A table seen from its side: top, apron, legs, and the dark below."""
    canvas = Canvas((2.0, 0.75), (58, 50, 44))
    canvas.shade(0, 0, 2.0, 0.75, 0.6, 1.3)
    for x in (0.05, 0.55, 1.05, 1.55):  # chairs
        canvas.fill(x + 0.03, 0.28, 0.34, 0.06, BLUE)
        canvas.fill(x + 0.03, 0.12, 0.34, 0.12, (52, 74, 112))
        for leg in (0.04, 0.34):
            canvas.fill(x + leg, 0.34, 0.03, 0.41, STEEL)
    canvas.fill(0, 0, 2.0, 0.05, OAK)
    canvas.fill(0.04, 0.05, 1.92, 0.06, (150, 114, 74))
    for x in (0.0, 1.93):
        canvas.fill(x, 0.05, 0.07, 0.7, (168, 128, 84))
    return canvas.finished()


def shelf() -> np.ndarray:
    """Books and boxes on the boards of a shelf."""
    canvas = Canvas((1.6, 1.9), (64, 54, 44))
    rng = np.random.default_rng(7)
    inks = [RED, BLUE, GREEN, SAND, WHITE, DARK, (190, 140, 60), (120, 80, 110), GREY]
    for board in range(5):
        y, x = 0.06 + 0.35 * board, 0.05
        while x < 1.5:
            wide, high = rng.uniform(0.03, 0.075), rng.uniform(0.2, 0.29)
            if rng.random() < 0.12:
                x += rng.uniform(0.05, 0.2)
                continue
            ink = inks[rng.integers(len(inks))]
            wide = min(wide, 1.55 - x)
            canvas.fill(x, y + 0.31 - high, wide, high, ink)
            canvas.shade(x, y + 0.31 - high, 0.012, high, 0.7, 0.7)
            canvas.fill(x + 0.012, y + 0.36 - high, wide - 0.018, 0.02, WHITE)
            x += wide
        canvas.shade(0.05, y, 1.5, 0.12, 0.55, 1.0)
    for board in range(6):
        canvas.fill(0, 0.03 + 0.35 * board, 1.6, 0.035, WALNUT)
    for x in (0.0, 0.78, 1.56):
        canvas.fill(x, 0, 0.04, 1.9, WALNUT)
    canvas.fill(0, 1.82, 1.6, 0.08, (70, 50, 36))
    canvas.grain(0.06, 0.02, 0.03)
    return canvas.finished()


def sofa(ink: Colour) -> np.ndarray:
    """Cushions between two arms."""
    canvas = Canvas((1.6, 0.75), ink, 7.0)
    dark = tuple(int(0.45 * c) for c in ink)
    for x in (0.2, 0.8):
        canvas.panel(x, 0.02, 0.6, 0.36, ink)
        canvas.panel(x, 0.37, 0.6, 0.16, tuple(int(min(1.12 * c, 255)) for c in ink))
    canvas.fill(0.2, 0.53, 1.2, 0.14, tuple(int(0.75 * c) for c in ink))
    for x in (0.0, 1.4):
        canvas.panel(x, 0.14, 0.2, 0.54, ink)
        canvas.fill(x, 0.0, 0.2, 0.14, dark)
    canvas.fill(0, 0.68, 1.6, 0.07, DARK)
    for x in (0.06, 1.46):
        canvas.fill(x, 0.68, 0.06, 0.07, WALNUT)
    return canvas.finished()


def fridge() -> np.ndarray:
    """A fridge with two doors."""
    canvas = Canvas((0.65, 1.8), (214, 217, 219), 3.0)
    canvas.panel(0, 0.0, 0.65, 0.6, (214, 217, 219))
    canvas.panel(0, 0.6, 0.65, 1.13, (208, 212, 215))
    for y in (0.25, 0.68):
        canvas.fill(0.06, y, 0.03, 0.3, GREY)
    for x, y, ink in ((0.3, 0.2, RED), (0.42, 0.14, SAND), (0.35, 0.36, BLUE)):
        canvas.fill(x, y, 0.1, 0.12, ink)
    canvas.fill(0, 1.73, 0.65, 0.07, DARK)
    return canvas.finished()


def rack() -> np.ndarray:
    """A rack of devices with lamps and vents."""
    canvas = Canvas((1.2, 1.9), (96, 100, 106))
    rng = np.random.default_rng(3)
    for left in (0.03, 0.62):
        y = 0.08
        while y < 1.72:
            high = float(rng.choice([0.09, 0.14, 0.22]))
            high = min(high, 1.78 - y)
            ink = [(70, 74, 80), STEEL, (48, 52, 58), PALE][rng.integers(4)]
            canvas.panel(left, y, 0.55, high, ink)
            for slot in range(rng.integers(3, 7)):
                canvas.fill(left + 0.07 + 0.06 * slot, y + 0.03, 0.035, high - 0.06, (38, 40, 44))
            canvas.fill(left + 0.48, y + 0.03, 0.025, 0.025, [GREEN, RED, SAND][rng.integers(3)])
            y += high
    canvas.fill(0, 1.82, 1.2, 0.08, DARK)
    return canvas.finished()


def machine() -> np.ndarray:
    """A machine tool: a window, a panel of buttons, and a base."""
    canvas = Canvas((1.3, 1.4), (120, 136, 128))
    canvas.panel(0.0, 0.0, 1.3, 0.95, (168, 182, 170))
    canvas.panel(0.1, 0.12, 0.72, 0.55, (58, 66, 72))
    canvas.shade(0.1, 0.12, 0.72, 0.55, 1.5, 0.8)
    canvas.panel(0.92, 0.15, 0.28, 0.45, (70, 74, 80))
    for row in range(4):
        for column, ink in enumerate((RED, SAND, GREEN)):
            canvas.fill(0.96 + 0.075 * column, 0.3 + 0.07 * row, 0.04, 0.04, ink)
    canvas.fill(0.95, 0.19, 0.22, 0.08, (120, 170, 150))
    canvas.panel(0.0, 0.95, 1.3, 0.37, (90, 104, 98))
    for slot in range(9):
        canvas.fill(0.12 + 0.12 * slot, 1.05, 0.06, 0.16, (48, 54, 52))
    canvas.fill(0, 1.32, 1.3, 0.08, DARK)
    return canvas.finished()


def crate() -> np.ndarray:
    """Planks between two boards."""
    canvas = Canvas((0.8, 0.8), (186, 146, 96))
    for row in range(6):
        canvas.panel(0, 0.133 * row, 0.8, 0.133, [(186, 146, 96), (172, 132, 84)][row % 2])
    canvas.grain(0.15, 0.01, 0.08)
    for x in (0.02, 0.66):
        canvas.panel(x, 0, 0.12, 0.8, (160, 122, 78))
        for y in (0.06, 0.34, 0.46, 0.72):
            canvas.fill(x + 0.045, y, 0.03, 0.03, DARK)
    return canvas.finished()


def bed() -> np.ndarray:
    """A hospital's bed from its side: blanket, mattress, frame and wheels."""
    canvas = Canvas((2.0, 0.62), (62, 64, 68), 4.0)
    canvas.fill(0.02, 0.02, 1.96, 0.24, WHITE)
    canvas.fill(0.6, 0.0, 1.36, 0.3, (150, 178, 204))
    canvas.shade(0.6, 0.0, 1.36, 0.3, 1.1, 0.85)
    canvas.panel(0.06, 0.0, 0.45, 0.1, (244, 244, 240))
    canvas.fill(0, 0.3, 2.0, 0.06, STEEL)
    canvas.shade(0, 0.36, 2.0, 0.2, 0.5, 1.0)
    for x in (0.1, 1.82):
        canvas.fill(x, 0.34, 0.06, 0.2, STEEL)
        canvas.fill(x - 0.02, 0.53, 0.1, 0.09, (30, 30, 32))
    for x in (0.3, 0.55, 1.3, 1.55):
        canvas.fill(x, 0.06, 0.025, 0.28, GREY)
    return canvas.finished()


def door(ink: Colour) -> np.ndarray:
    """A door's leaf with a handle, a sign and a kick plate."""
    canvas = Canvas((0.95, 2.05), ink, 4.0)
    canvas.grain(0.012, 0.3, 0.05)
    canvas.fill(0.28, 0.3, 0.38, 0.1, WHITE)
    canvas.fill(0.31, 0.33, 0.2, 0.03, DARK)
    canvas.fill(0.8, 1.0, 0.06, 0.2, STEEL)
    canvas.fill(0.7, 1.03, 0.14, 0.03, DARK)
    canvas.fill(0, 1.8, 0.95, 0.25, STEEL)
    canvas.shade(0, 1.8, 0.95, 0.25, 1.05, 0.9)
    return canvas.finished()


def window() -> np.ndarray:
    """Two sashes; outside a pale sky, a row of houses and trees."""
    canvas = Canvas((1.6, 1.3), (226, 236, 246), 2.0)
    rng = np.random.default_rng(11)
    canvas.shade(0, 0, 1.6, 1.3, 0.93, 1.05)
    x = 0.0
    while x < 1.6:
        wide, high = rng.uniform(0.15, 0.35), rng.uniform(0.25, 0.6)
        tone = int(rng.uniform(150, 195))
        canvas.fill(x, 1.2 - high, wide, high, (tone, tone - 6, tone - 14))
        for row in range(int(high / 0.11)):
            for column in range(int(wide / 0.09)):
                at = x + 0.03 + 0.09 * column, 1.23 - high + 0.11 * row
                canvas.fill(*at, 0.04, 0.055, (110, 122, 134))
        x += wide
    grey = cv2.GaussianBlur(rng.standard_normal(canvas.image.shape[:2]), (0, 0), 6)
    trees = np.zeros_like(grey, dtype=bool)
    trees[round(0.75 * len(grey)) :] = grey[round(0.75 * len(grey)) :] > 0.02
    canvas.image[trees] = (118, 142, 104)
    for x in (0.0, 0.765, 1.53):
        canvas.fill(x, 0, 0.07, 1.3, WHITE)
    for y in (0.0, 1.16):
        canvas.fill(0, y, 1.6, 0.07, WHITE)
    canvas.fill(0, 1.23, 1.6, 0.07, PALE)
    for x in (0.07, 0.835):
        canvas.shade(x, 0.07, 0.025, 1.09, 0.75, 0.75)
        canvas.shade(x, 0.07, 0.695, 0.025, 0.75, 0.75)
    canvas.fill(0.74, 0.6, 0.03, 0.14, GREY)
    return canvas.finished()


def painting(seed: int) -> np.ndarray:
    """Fields of colour within a mount and a frame."""
    canvas = Canvas((0.9, 0.7), DARK, 3.0)
    rng = np.random.default_rng(seed)
    canvas.fill(0.035, 0.035, 0.83, 0.63, WHITE)
    inks = [RED, BLUE, GREEN, SAND, (214, 160, 70), (70, 110, 120), DARK]
    canvas.fill(0.11, 0.11, 0.68, 0.48, inks[rng.integers(len(inks))])
    for _ in range(9):
        x, y = rng.uniform(0.11, 0.6), rng.uniform(0.11, 0.45)
        wide, high = rng.uniform(0.06, 0.79 - x), rng.uniform(0.05, 0.59 - y)
        canvas.fill(x, y, wide, high, inks[rng.integers(len(inks))])
    return canvas.finished()


def board() -> np.ndarray:
    """A notice board with papers."""
    canvas = Canvas((1.4, 0.9), (176, 138, 96), 6.0)
    rng = np.random.default_rng(5)
    for column in range(6):
        for row in range(3):
            if rng.random() < 0.8:
                x, y = 0.08 + 0.21 * column, 0.07 + 0.27 * row
                canvas.fill(x, y, 0.16, 0.22, WHITE if rng.random() < 0.7 else SAND)
                for line in range(5):
                    canvas.fill(
                        x + 0.02, y + 0.04 + 0.033 * line, rng.uniform(0.05, 0.12), 0.012, GREY
                    )
                canvas.fill(x + 0.07, y - 0.008, 0.02, 0.02, RED)
    for x, y, wide, high in (
        (0, 0, 1.4, 0.03),
        (0, 0.87, 1.4, 0.03),
        (0, 0, 0.03, 0.9),
        (1.37, 0, 0.03, 0.9),
    ):
        canvas.fill(x, y, wide, high, GREY)
    return canvas.finished()


def ceiling() -> np.ndarray:
    """Tiles of a suspended ceiling, 0.6 m, and a lamp every 2.4 m."""
    canvas = Canvas((2.4, 2.4), (205, 204, 200), 2.0)
    for column in range(4):
        for row in range(4):
            x, y = 0.6 * column, 0.6 * row
            canvas.fill(x, y, 0.6, 0.02, (160, 160, 158))
            canvas.fill(x, y, 0.02, 0.6, (160, 160, 158))
    canvas.fill(0.6, 1.2, 1.2, 0.6, (150, 150, 148))
    canvas.fill(0.64, 1.24, 1.12, 0.52, (255, 255, 252))
    return canvas.finished()


def tiles(ink: Colour, joint: Colour, edge: float, spread: float, grain: float) -> np.ndarray:
    """Square tiles of varied tone with joints, six by six."""
    size = 6 * edge
    canvas = Canvas((size, size), ink, 3.0)
    rng = np.random.default_rng(sum(ink))
    canvas.grain(0.05, 0.05, 0.4 * grain)
    canvas.grain(0.014, 0.014, grain)
    count = round(size / edge)
    for column in range(count):
        for row in range(count):
            tone = 1.0 + spread * rng.standard_normal()
            canvas.shade(edge * column, edge * row, edge, edge, tone, tone)
    for line in range(count):
        canvas.fill(edge * line, 0, 0.012, size, joint)
        canvas.fill(0, edge * line, size, 0.012, joint)
    return canvas.finished()


def leaves() -> np.ndarray:
    """Leaves of a plant."""
    canvas = Canvas((0.9, 0.9), (34, 52, 30), 5.0)
    rng = np.random.default_rng(2)
    for _ in range(420):
        at = rng.uniform(0, canvas.image.shape[1::-1])
        green = rng.uniform(0.6, 1.5)
        ink = (70 * green, 98 * green, 54 * green)
        axes = (int(rng.uniform(3, 6)), int(rng.uniform(8, 17)))
        for shift in (-canvas.image.shape[1], 0, canvas.image.shape[1]):
            centre = (int(at[0]) + shift, int(at[1]))
            cv2.ellipse(
                canvas.image, centre, axes, rng.uniform(-60, 60), 0, 360, ink, -1, cv2.LINE_AA
            )
    return canvas.finished()


DRAWN: dict[str, Callable[[], np.ndarray]] = {
    "sideboard": lambda: drawers(2, 2, WALNUT, (1.2, 0.9)),
    "chest": lambda: drawers(1, 3, OAK, (0.9, 0.75)),
    "bench": lambda: drawers(3, 2, (150, 118, 84), (2.4, 0.9)),
    "counter": lambda: cupboard(4, WHITE, (2.2, 0.95), (90, 86, 82)),
    "lab-bench": lambda: cupboard(3, PALE, (1.6, 0.9), (60, 64, 70)),
    "cabinet": lambda: cupboard(2, STEEL, (1.1, 1.5), PALE),
    "wardrobe": lambda: cupboard(3, WALNUT, (1.4, 1.8), (140, 100, 70)),
    "reception": lambda: cupboard(3, OAK, (1.6, 1.05), (226, 222, 214)),
    "desk": desk,
    "table": table,
    "shelf": shelf,
    "sofa": lambda: sofa(RED),
    "fridge": fridge,
    "rack": rack,
    "machine": machine,
    "crate": crate,
    "bed": bed,
    "door": lambda: door((188, 150, 106)),
    "window": window,
    "painting-1": lambda: painting(1),
    "painting-2": lambda: painting(4),
    "board": board,
    "ceiling": ceiling,
    "wall-tiles": lambda: tiles((220, 224, 222), (168, 172, 170), 0.2, 0.03, 0.05),
    "floor-tiles": lambda: tiles((168, 160, 148), (112, 106, 98), 0.4, 0.05, 0.11),
    "leaves": leaves,
}


def main() -> None:
    """Write the pictures."""
    PICTURES.mkdir(exist_ok=True)
    for name, draw in DRAWN.items():
        picture = cv2.cvtColor(draw(), cv2.COLOR_RGB2BGR)
        cv2.imwrite(str(PICTURES / f"{name}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
