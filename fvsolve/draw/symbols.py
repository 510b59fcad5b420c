"""Symbols of the kinds of parts, as in drawings of pipework and fluid power.

A symbol is a text of strokes in a square from -1 to 1, with the flow along x. `M x y` moves and `L x y` draws to a
point, `Z` closes a stroke, `O x y r` is a circle. Closed strokes are filled white, after `*` with ink, after `~` with
the colour of water. A kind without a symbol uses the symbol of the kind from which it is derived (an orifice is a
valve), else OTHER_NODE or OTHER_LINK: a new kind of part needs no entry here.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

VALVE_BODY = "M -1 -.6 L 1 .6 L 1 -.6 L -1 .6 Z"
VALVE_STEM = "M 0 0 L 0 .7"
CAPSULE = "M -.7 -.9 L .7 -.9 L .7 .4 L .55 .75 L .3 .93 L 0 1 L -.3 .93 L -.55 .75 L -.7 .4 Z"
FILLED_BOX = "M -.8 -.8 L -.8 .8 L .8 .8 L .8 -.8 Z"
SYMBOLS = {
    "junction": "* O 0 0 .32",
    "reservoir": "M -.9 .7 L .9 .7 L 0 -.5 Z M -.6 -.75 L .6 -.75 M -.3 -1 L .3 -1",  # a free surface
    "tank": "M -.75 .9 L -.75 -.9 L .75 -.9 L .75 .9 Z ~ M -.75 .2 L -.75 -.9 L .75 -.9 L .75 .2 Z",
    "basin": "M -1 .5 L -1 -.6 L 1 -.6 L 1 .5 Z ~ M -1 .1 L -.5 .25 L 0 .1 L .5 .25 L 1 .1 L 1 -.6 L -1 -.6 Z",
    "accumulator": f"{CAPSULE} ~ M -.7 0 L -.7 -.9 L .7 -.9 L .7 0 Z",
    "chamber": "O 0 0 .8",
    "inflow": "* M -.2 -.5 L -.2 .5 L .9 0 Z M -1 0 L -.2 0",
    "air-valve": "O 0 -.2 .65 M 0 .45 L 0 1 M -.3 .7 L 0 1 L .3 .7",
    "valve": VALVE_BODY,
    "orifice": "M 0 1 L 0 .3 M 0 -1 L 0 -.3 M -.25 1 L .25 1 M -.25 -1 L .25 -1",
    "leak": "M 0 .9 L .55 -.2 L .4 -.7 L 0 -.9 L -.4 -.7 L -.55 -.2 Z",
    "check-valve": "* M -.8 -.7 L -.8 .7 L .7 0 Z M .75 -.8 L .75 .8",
    "relief-valve": f"{VALVE_BODY} M 0 0 L -.25 .25 L .25 .45 L -.25 .65 L .25 .85 L 0 1",  # its spring
    "surge-anticipating": f"{VALVE_BODY} {VALVE_STEM} * O 0 .75 .25",  # its pilot
    "rupture-disc": "M -.8 -.7 L -.8 .7 L .8 .7 L .8 -.7 Z M -.2 -.7 L .1 -.35 L .2 0 L .1 .35 L -.2 .7",
    "pressure-reducing": f"{VALVE_BODY} {VALVE_STEM} M -.5 .6 L -.3 1 L .3 1 L .5 .6 Z * M 0 0 L 1 .6 L 1 -.6 Z",
    "pressure-sustaining": f"{VALVE_BODY} {VALVE_STEM} M -.5 .6 L -.3 1 L .3 1 L .5 .6 Z * M 0 0 L -1 .6 L -1 -.6 Z",
    "flow-control": f"{VALVE_BODY} {VALVE_STEM} M -.5 .6 L -.3 1 L .3 1 L .5 .6 Z",
    "pump": "O 0 0 .9 * M -.4 .7 L -.4 -.7 L .85 0 Z",
    "turbine": "O 0 0 .9 * M .4 .7 L .4 -.7 L -.85 0 Z",
    "spool-valve": "M -1 -.4 L -1 .4 L 1 .4 L 1 -.4 Z M -.35 -.4 L -.35 .4 M .35 -.4 L .35 .4 M -.8 -.3 L -.5 .3",
    "cylinder": "M -1 -.5 L -1 .5 L .6 .5 L .6 -.5 Z * M -.25 -.5 L -.25 .5 L -.05 .5 L -.05 -.5 Z M 0 0 L 1 0",
    "rigid-column": "* M -1 -.2 L -1 .2 L 1 .2 L 1 -.2 Z",
    "bushing": "M -.8 -.4 L .8 -.4 M -.8 .4 L .8 .4 * M -.6 -.15 L -.6 .15 L .6 .15 L .6 -.15 Z",
    "pin": "O 0 0 .6 * O 0 0 .2",
    "mass": f"* {FILLED_BOX}",
    "body": "* M -.9 -.3 L -.9 .3 L .9 .3 L .9 -.3 Z",
    "frame": "M -1 .3 L 1 .3 M -.8 -.3 L -.4 .3 M -.2 -.3 L .2 .3 M .4 -.3 L .8 .3",
    "spring": "M -1 0 L -.7 0 L -.5 .5 L -.1 -.5 L .3 .5 L .7 -.5 L .8 0 L 1 0",
    "damper": "M -1 0 L -.1 0 M -.1 -.35 L -.1 .35 M .5 -.5 L -.5 -.5 M .5 .5 L -.5 .5 M .5 -.5 L .5 .5 M .5 0 L 1 0",
    "end-stop": "M -1 0 L .2 0 M .2 -.5 L .2 .5 * M .5 -.8 L .5 .8 L .8 .8 L .8 -.8 Z",
    "force": "M -1 0 L .3 0 * M .3 -.4 L .3 .4 L 1 0 Z",
    "torque": "M .5 -.6 L -.2 -.75 L -.75 -.2 L -.7 .4 L -.1 .75 L .4 .6 * M .3 .95 L .8 .3 L 0 .25 Z",
}
OTHER_NODE, OTHER_LINK = FILLED_BOX, "M -1 0 L 0 .7 L 1 0 L 0 -.7 Z"

WATER = "#8ab6d6"


def symbol_of(kinds: Sequence[str], link: bool) -> str:
    """Symbol of a part, as a text of strokes (see `strokes`).

    kinds : kind of the part and the kinds from which it is derived, nearest first; link : True for a link
    """
    return next((SYMBOLS[kind] for kind in kinds if kind in SYMBOLS), OTHER_LINK if link else OTHER_NODE)


@cache
def strokes(symbol: str) -> list[tuple[str, tuple[tuple[float, float], ...], bool]]:
    """Strokes of a symbol in the order of drawing : list of (fill, points, True if closed).

    fill : "white", "ink" or "water"
    """
    result: list[tuple[str, list, bool]] = []
    words, at, fill = symbol.split(), 0, "white"
    while at < len(words):
        word = words[at]
        if word in "*~":
            fill, at = {"*": "ink", "~": "water"}[word], at + 1
        elif word == "Z":
            result[-1] = (*result[-1][:2], True)
            fill, at = "white", at + 1
        elif word == "O":
            x, y, r = map(float, words[at + 1 : at + 4])
            result.append((fill, _circle(x, y, r), True))
            fill, at = "white", at + 4
        else:
            if word == "M":
                result.append((fill, [], False))
            result[-1][1].append((float(words[at + 1]), float(words[at + 2])))
            at += 3
    return [(fill, tuple(points), closed) for fill, points, closed in result]


def _circle(x: float, y: float, r: float) -> list[tuple[float, float]]:
    from math import cos, pi, sin

    return [(x + r * cos(k * pi / 16), y + r * sin(k * pi / 16)) for k in range(32)]
