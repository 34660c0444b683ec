"""The paper in one file: from two camera images to a sentence, to a command, to the wheels.

Read it from top to bottom with Mai and Janschek, "Bio-inspired Optical Flow Interpretation with
Fuzzy Logic for Behavior-Based Robot Control" (RAAD 2009), beside it: sections, figures and tables
are the paper's. What the paper leaves open, such as most numbers, is navfw's. The fuzzy rules are
text, in the files that each `Fis` names. docs/paper.md says what is left out, and why.

    python examples/paper_in_one_file.py [PAST NOW METRES DEGREES SECONDS]

METRES driven and DEGREES turned left between the images; by default the two beside this file.
"""

import sys
from collections import namedtuple
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from navfw.fuzzy import CompiledFis, load_rule_base

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT, FOCAL = 160, 120, 80.0  # sec 6.1: 120 x 160; focal length [px] of a view of 90 deg
ROWS, COLS, WINDOW, SEARCH = 12, 16, 24, 8  # sec 6: 12 x 16 vectors, windows of 24 x 24 pixels
CAMERA_AHEAD, WHEEL, TRACK = 0.10, 0.05, 0.28  # of the axle; wheels' radius; between wheels [m]
TOP_SPEED, TOP_TURN = 0.5, 1.2  # [m/s], [rad/s]
SPEEDS, TURNS = np.array([-0.3, -0.15, *np.linspace(0.0, 1.0, 9)]), np.linspace(-1.0, 1.0, 21)


# --- Sec 5.1, Fig. 9: a fuzzy inference system (FIS) ----------------------------------------------
@cache
def system(file):
    """Load the data base (membership functions) and the rule base of a FIS."""
    return CompiledFis(load_rule_base(HERE.parent / f"{file}.yaml"))


class Fis:
    """Fuzzify inputs, apply the rules (AND is min, OR max); ``result.first``: a term's strength."""

    def __init__(self, file, **inputs):
        self.outputs = system(file).rule_base.outputs
        self.result = system(file).evaluate(inputs)

    def crisp(self, output):
        """Defuzzify by the centroid."""
        return self.result.crisp(output)[0]

    def degree(self, output):
        """Defuzzify to a degree: the mean of the terms' peaks, weighted by strength."""
        universe, strengths = self.outputs[output].universe, self.result.activations(output)
        sets = [term(universe) for term in self.outputs[output].terms.values()]
        peaks = [universe[s >= s.max() - 1e-9].mean() for s in sets]
        return np.dot(strengths, peaks) / max(sum(strengths), 1e-9)

    def fuzzy_set(self, output, values):
        """Do not defuzzify: join the terms, each cut at its strength, to one set over values."""
        terms = [term(values) for term in self.outputs[output].terms.values()]
        return np.minimum(terms, np.array(self.result.activations(output))[:, None]).max(axis=0)


# --- Sec 3: optical flow (OF) without its rotational component ------------------------------------
def derotate(past, turn):
    """Turn the past image by the gyro's angle (AUX in Fig. 2); NaN is what it does not show.

    Sec 3: "it is mandatory to remove the rotational component before starting the 3D OF
    processing". Removed before the matching, it does not distort the windows either.
    """
    c, s, border = np.cos(turn), np.sin(turn), np.array([-0.5, 0.5]) * WIDTH
    moved = (c * border + s * FOCAL) / (c - s * border / FOCAL)
    if np.abs(moved - border).max() <= 0.05:  # [px]: too little to be seen
        return past.astype(float)
    rays = np.array([[FOCAL, 0, WIDTH / 2 - 0.5], [0, FOCAL, HEIGHT / 2 - 0.5], [0, 0, 1]])
    to_past = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    warp, how = rays @ to_past @ np.linalg.inv(rays), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    turned = cv2.warpPerspective(past, warp, (WIDTH, HEIGHT), None, how, cv2.BORDER_REPLICATE)
    (first, end), column = moved + 0.5 * WIDTH + (-1e-6, 1e-6), np.arange(WIDTH)
    return np.where((column >= first) & (column + 1 <= end), turned.astype(float), np.nan)


CELL, SIDES = WIDTH // COLS, (-WINDOW, WINDOW)  # windows overlap; at the border they are clipped
LEFT, RIGHT = (np.clip(CELL * np.arange(COLS) + (CELL + s) // 2, 2, WIDTH - 2) for s in SIDES)
TOP, BOTTOM = (np.clip(CELL * np.arange(ROWS) + (CELL + s) // 2, 2, HEIGHT - 2) for s in SIDES)
X, Y = np.meshgrid((LEFT + RIGHT - WIDTH) / 2, (TOP + BOTTOM - HEIGHT) / 2)  # centres [px]


def match(past, now, r, c):
    """Find the window (r, c) of the present image in the past one, by 2-D correlation (sec 3).

    Returns u, v [px], and 1 if reliable, else 0; a quadratic surface gives fractions of a pixel.
    """
    window = now[TOP[r] : BOTTOM[r], LEFT[c] : RIGHT[c]].astype(float)
    reach = past[TOP[r] : BOTTOM[r] + 2 * SEARCH, LEFT[c] : RIGHT[c] + 2 * SEARCH]
    shifted = np.lib.stride_tricks.sliding_window_view(reach, window.shape)[::-1, ::-1]
    n, total, totals = window.size, window.sum(), shifted.sum(axis=(2, 3))
    energy = n * (window**2).sum() - total**2
    energies = np.maximum(n * (shifted**2).sum(axis=(2, 3)) - totals**2, 1.0)
    covariance = n * (shifted * window).sum(axis=(2, 3)) - total * totals
    score = covariance * (1.0 / np.sqrt(max(energy, 1.0))) * (1.0 / np.sqrt(energies))
    score = np.pad(np.nan_to_num(score, nan=-2.0).astype(np.float32), 2, constant_values=-2.0)
    v, u = np.divmod(score[1:-1, 1:-1].argmax(), 2 * SEARCH + 3)
    s = score[v : v + 3, u : u + 3].copy()  # sums of these are of single precision
    score[v : v + 3, u : u + 3] = -2.0
    gx, gy = float(sum((*s[:, 2], *-s[:, 0]))) / 6, float(sum((*s[2], *-s[0]))) / 6
    xx = (float(sum((*s[:, 0], *s[:, 2]))) - 2 * float(sum(s[:, 1]))) / 3
    yy = (float(sum((*s[0], *s[2]))) - 2 * float(sum(s[1]))) / 3
    xy, height = float(sum((s[0, 0], s[2, 2], -s[0, 2], -s[2, 0]))) / 4, float(s[1, 1])
    peaked = s.min() > -2.0 and xx + yy + np.hypot(xx - yy, 2 * xy) < 0.0
    unique = 1.0 - float(score.max()) > max(1.0 - height, 1e-3)
    textured = np.sqrt(energy) / n > 2.0  # standard deviation [grey levels]
    if not (peaked and unique and textured and height > 0.7):
        return 0.0, 0.0, 0.0
    u += np.clip((xy * gy - yy * gx) / (xx * yy - xy**2), -0.5, 0.5) - SEARCH - 1
    v += np.clip((xy * gx - xx * gy) / (xx * yy - xy**2), -0.5, 0.5) - SEARCH - 1
    return u, v, 1.0


# --- Sec 4.2: averaged OF vector metrics; sec 4.3: hierarchical segmentation ----------------------
NUMBER, FOUR = np.array([[2, 1], [3, 4]]), (1, 2, 3, 4)  # Fig. 4: P1 is upper right
ROW, COL = np.indices((ROWS, COLS))
P = {f"P{n}": NUMBER[ROW // 6, COL // 8] == n for n in FOUR}  # Fig. 5a: layer 1, 6 x 8 vectors each
SP = {f"s{p}{n}": P[p] & (NUMBER[ROW % 6 // 3, COL % 8 // 4] == n) for p in P for n in FOUR}  # 5b
PLACES = {"P1": "upper right", "P2": "upper left", "P3": "lower left", "P4": "lower right"}
INNER = "sP12", "sP13", "sP21", "sP24", "sP31", "sP34", "sP42", "sP43"  # of the whole image
Area = namedtuple("Area", "mu_u mu_v size nearness known")  # [px] [px] [px] [1/m] [share]
Percept = namedtuple("Percept", "sentence parts distances slopes situations")


def average(u, v, reliable, expected, area):
    """Average projections on U and V over an area (Fig. 4); nearness is flow by that at 1 m."""
    chosen = (reliable > 0.0) & area
    mu_u, mu_v = (np.abs(d[chosen]).sum() / max(chosen.sum(), 1) for d in (u, v))
    nearness = np.hypot(u, v)[chosen].sum() / max(expected[chosen].sum(), 1e-9)
    return Area(mu_u, mu_v, np.hypot(mu_u, mu_v), nearness, chosen.sum() / area.sum())


# --- Sec 4.5, Fig. 8, and sec 5.2: OFFIS ----------------------------------------------------------
def plane(i, j):
    """Sec 5.2 a: IF mu_U OR mu_V of parts are equal THEN one plane; if alike in size one object."""
    width, height = (abs(a - b) / max(a + b, 1e-12) for a, b in zip(i[:2], j[:2], strict=True))
    size = min(i.size, j.size) / max(i.size, j.size, 1e-12)
    return Fis("navfw/offis/rules/plane", width=width, height=height, size=size)


def biggest(areas, names):
    """Sec 4.5: find the biggest of four parts, and its neighbours that share a plane with it."""
    shown = [name for name in names if areas[name].nearness > 0.1]  # within 10 m
    chosen = {max(shown, key=lambda name: areas[name].size)} if shown else set()
    least = 0.7 * max((areas[name].size for name in chosen), default=0.0)
    for i in range(12):  # three times round, to the end of a chain of neighbours
        one, other = names[i % 4], names[(i + 1) % 4]
        if {one, other} <= set(shown) and len({one, other} & chosen) == 1:
            same = plane(areas[one], areas[other]).result.first("object")["same"]
            if same >= 0.5 and min(areas[one].size, areas[other].size) >= least:
                chosen |= {one, other}
    return sorted(chosen)


def slope(outer, inner):
    """Sec 5.2 b: 2 very slope ([3 1] left, [1 3] right), 1 slope, 0 orthogonal, -1, -2 unusual."""
    ratio = (outer.size - inner.size) / max(outer.size + inner.size, 1e-12)
    return Fis("navfw/offis/rules/slope_paper", outer=ratio).crisp("slope")


def distance(area, speed):
    """Sec 4.5, last step: degrees of near, middle and far, by distance and time to contact."""
    metres = 1.0 / max(area.nearness, 1e-3)
    contact = metres / speed if speed > 0.02 else 1e3
    fis = Fis("navfw/offis/rules/distance", distance=metres, contact=contact)
    return {term: x * min(area.known / 0.1, 1.0) for term, x in fis.result.first("range").items()}


def report(layer, names, distances):
    """Say where the nearest object is, in the words of Tab. 3."""
    terms, nearest = ("near", "middle", "far"), {}
    for name in names:
        place, term = PLACES[name[-layer - 1 :][:2]], max(terms, key=distances[name].get)
        nearest[place] = min(nearest.get(place, "far"), term, key=terms.index)
    if not names:
        seen = any(any(degrees.values()) for degrees in distances.values())
        return f"Layer{layer}: {'no object in sight' if seen else 'nearest object is unknown'}"
    if layer == 1:  # one distance for all
        nearest = {" and on ".join(nearest): min(nearest.values(), key=terms.index)}
    where = (f"on {place} in {term} distance" for place, term in nearest.items())
    return f"Layer{layer}: nearest object is {' and '.join(where)}"


def offis(past, now, moved, turn, speed):
    """Interpret two images; ``moved`` (ahead, left) [m] in present axes, ``turn`` left [rad]."""
    past = np.pad(derotate(past, turn), SEARCH, constant_values=np.nan)
    matches = [match(past, now, r, c) for r, c in np.ndindex(ROWS, COLS)]
    u, v, reliable = np.array(matches).T.reshape(3, ROWS, COLS)
    ahead = moved[0] + CAMERA_AHEAD * (1.0 - np.cos(turn))
    aside = moved[1] + CAMERA_AHEAD * np.sin(turn)
    expected = np.hypot(X * ahead + FOCAL * aside, Y * ahead)  # flow of a point 1 m away [px]
    reliable *= np.hypot(ahead, aside) >= 0.005  # [m]: depth needs translation
    areas = {name: average(u, v, reliable, expected, cells) for name, cells in (P | SP).items()}
    layer1 = biggest(areas, list(P))
    layer2 = [name for p in layer1 for name in biggest(areas, [f"s{p}{n}" for n in FOUR])]
    distances = {name: distance(area, speed) for name, area in areas.items()}

    # sec 4.4: P2 and P3 are the left plane, P1 and P4 the right one; 5.2 c: Tab. 1
    quarters = [average(u, v, reliable, expected, column == COL // 4) for column in range(4)]
    left, right = slope(quarters[0], quarters[1]), slope(quarters[3], quarters[2])
    support = min(1.0, *(quarter.known / 0.2 for quarter in quarters))
    table = Fis("navfw/offis/rules/situation", left=left, right=right).result.first("situation")
    table = {entry.replace("_", " "): support * value for entry, value in table.items()}
    table["unknown"] = max(table["unknown"], 1.0 - support)
    front = f"Front is a {max(table, key=table.get)}".replace("a unknown", "unknown")
    sentence = f"{report(1, layer1, distances)}; {report(2, layer2, distances)}; {front}"
    return Percept(sentence, layer2, distances, (left, right), table)


# --- Sec 2: MOFIS: primitive behaviours, their composite (Fig. 1), and fusion ---------------------
def desire(fis, turn=np.inf):
    """Desirability of all commands: the fuzzy set of speeds times that of turns and ``turn``."""
    turns = np.maximum(fis.fuzzy_set("turn", TURNS), 1.0 - np.abs(TURNS - turn) / 0.3)
    desired = np.outer(fis.fuzzy_set("speed", SPEEDS), turns)
    return desired / max(desired.max(), 1e-3)


def mofis(percept, goal, floor=1.0):
    """Decide on v [m/s], w [rad/s] for PAPFIS' waypoint (ahead, left) [m]; ``floor`` is given."""
    crisp = {  # 0 is near, 0.5 middle or unknown, 1 far
        name: (0.5 * d["middle"] + d["far"]) / sum(d.values()) if any(d.values()) else 0.5
        for name, d in percept.distances.items()
    }
    left, right = min(crisp["P2"], crisp["P3"]), min(crisp["P1"], crisp["P4"])
    ahead = min((crisp[name[1:3]] for name in percept.parts if name in INNER), default=1.0)
    bearing, metres = np.arctan2(goal[1], goal[0]), np.hypot(*goal)

    # the composite behaviour weighs the primitive ones
    view = {"idle": 0.0, "age": 0.0, "nearest": min(left, right, ahead), "ahead": ahead}
    due = metres if abs(bearing) <= 0.6 else np.inf
    react = Fis("behaviors/react", **view, bearing=abs(bearing), due=due)
    seek = Fis("behaviors/go_to_xy", bearing=np.degrees(bearing), distance=min(metres, 2.0))
    seeking = 0.8 * react.degree("go_to_xy"), desire(seek, seek.crisp("turn"))
    # obstacle avoidance: away from the nearer side, slower, and not toward what is near
    freer = np.clip(left - right + 0.25 * np.sin(0.5 * bearing), -1.0, 1.0)
    away = Fis("behaviors/avoid_quadrants", left=left, right=right, ahead=ahead, freer=freer)
    weight = 0.9 * react.degree("avoid_quadrants") * away.degree("applicability")
    proposals = [seeking, (weight, desire(away))]
    prohibited = np.zeros((SPEEDS.size, TURNS.size))
    for near, side in (left, TURNS), (right, -TURNS):
        if near < 0.2 <= ahead:
            prohibited[np.ix_(SPEEDS > 0.0, side > 0.15)] = 0.6
    prohibited[np.maximum(away.crisp("limit"), 0.0) < SPEEDS] += 0.4
    # emergency: nothing but a turn on the spot, to the freer side
    emergency = Fis("behaviors/emergency_quadrants", ahead=ahead, floor=floor, stalled=0.0)
    if emergency.degree("alarm") > 0.5:
        sense = np.copysign(0.8, left - right if abs(left - right) > 0.1 else bearing)
        turns = np.maximum(0.0, 1.0 - np.abs(TURNS - sense) / 0.4)
        proposals.append((1.0, np.outer(SPEEDS == 0.0, turns)))
        prohibited[SPEEDS > 0.0] = 1.0
    return fuse(proposals, prohibited)


def fuse(proposals, prohibited):
    """Fuse commands (Pirjanian 1999): weighted mean of all desires, without what is prohibited.

    Defuzzified by the centroid of one region: left and right of an obstacle are not averaged.
    """
    total = max(sum(weight for weight, _ in proposals), 1e-9)
    wanted = sum(weight / total * desired for weight, desired in proposals)
    wanted = np.where(prohibited > 0.5, 0.0, wanted * (1.0 - prohibited))
    best, top = wanted.max(), SPEEDS.size - 1
    if best <= 1e-6:
        return 0.0, 0.0
    regions = cv2.connectedComponents((wanted >= 0.8 * best).astype(np.uint8), connectivity=4)[1]
    heaviest = 1 + np.bincount(regions.ravel(), wanted.ravel())[1:].argmax()
    inside = np.where(regions == heaviest, wanted, 0.0)
    row, col = (np.average(np.indices(inside.shape)[axis], weights=inside) for axis in (0, 1))
    beyond = max(inside[top].max() / best - 0.8, 0.0) / 0.2
    row = top - (top - row) * (1.0 - beyond) / (1.0 + beyond)  # as if speeds went on beyond the top
    if prohibited[round(row), round(col)] > 0.5:
        row, col = np.unravel_index(inside.argmax(), inside.shape)
    v, w = np.interp(row, range(SPEEDS.size), SPEEDS), np.interp(col, range(TURNS.size), TURNS)
    return TOP_SPEED * v, TOP_TURN * w


def locom(v, w):
    """Sec 2, LOCOM: angular speeds [rad/s] of the left and the right wheel; slower in curves."""
    v = min(v, 0.6 / max(abs(w), 1e-6))  # lateral acceleration [m/s^2]
    return (v - 0.5 * TRACK * w) / WHEEL, (v + 0.5 * TRACK * w) / WHEEL


if __name__ == "__main__":
    shipped = HERE / "paper_past.png", HERE / "paper_now.png", 0.071, 1.1, 0.3
    past, now, *motion = sys.argv[1:] or shipped
    metres, degrees, seconds = map(float, motion)
    images = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in (past, now)]
    if any(image is None or image.shape != (HEIGHT, WIDTH) for image in images):
        sys.exit(f"expected two images of {WIDTH} x {HEIGHT} pixels, got {past} and {now}")
    turn = np.radians(degrees)
    moved = metres * np.cos(turn / 2), -metres * np.sin(turn / 2)
    percept = offis(*images, moved, turn, metres / seconds)
    command = mofis(percept, goal=(3.0, 0.0))
    print(percept.sentence)
    numbers = *command, *locom(*command)
    print("v {:+.3f} m/s, w {:+.3f} rad/s; wheels {:+.2f} and {:+.2f} rad/s".format(*numbers))
