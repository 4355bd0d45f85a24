"""Which way somebody walks, from acceleration, angular rate and field: for each step of any counter, where it shows.

A device carried along with the body (in the hand, on the belt): walking pushes forward and upward in the same rhythm,
twice a stride, while the sway to the sides has half of that. So of the horizontal acceleration h only what goes with
the vertical one u counts, in two parts: P = mean of h u, and Q = mean of h u′/ω, with u′ the change of u and ω what
makes both of one size. The direction is the main axis of P and Q together (least squares). Which of its ends is the
front is told by the phase of the motion along it: FORWARD ahead of u.

A device that swings (wrist, thigh): the line along which h moves is the limb's plane. To and fro are alike, so this is
a line, and no more: the direction or its opposite, in [0°, 180°).

Means are taken over MEMORY_S in a frame that turns with the body, so a turn shows at once (on the circles below,
without that: 26° for 14°). The uncertainty is a standard deviation: how people hold a device, what the coherence of h
with u leaves open, and how much the field's strength moves, which points to iron or currents. There is no heading where
nobody walks, the coherence is under COHERENT, the phase does not settle the front, or a swing is not narrow.

Measured against the long side of a phone held in the hand, truth as far as people point it ahead:

| walks | share of time | median error | about the walk's own mean (rms) | back to front | within 2 σ |
| --- | --- | --- | --- | --- | --- |
| brajdic, 13 walks | 67 % | 15° | 14° | none | 97 % |
| dcaiti, 4 walks of one person, with circles | 85 % | 25° | 14° | 0.06 % | 98 % |

On the wrists of eth2022 and eth2023 nothing tells the truth. Where the arm hangs still there is a direction; where it
swings a line, in 94, 89, 68 and 56 % of the time of plain walks and 8 to 24 % of those with much arm activity, which
lies at 58° to 72° to the watch's face in ten recordings of twelve. Synthetic arms give their line within 3°.

Nothing but samples decides: any cutting into blocks gives the same headings.
"""

from __future__ import annotations

from collections.abc import MutableSequence
from math import atan2, cos, degrees, pi, radians, sin, sqrt
from typing import Any, Final

from service.events import Heading
from service.samples import GRID_HZ, SampleBlock
from service.signals import orientation
from service.signals.orientation import DT_S

MEMORY_S: Final = 1.5
"""Of the means P, Q: more than a stride."""
SWAY_S: Final = 1.0
"""What is slower than this is no step: an error of `up`, or a turn."""
FORWARD: Final = radians(125.0)
"""Phase by which forward acceleration is ahead of vertical: 57° to 161° in the walks below."""
SETTLED: Final = 0.4
"""Cosine of the deviation from FORWARD that the front needs: within 66°."""
COHERENT: Final = 0.3
"""Share of the horizontal motion that must go with the vertical one."""
WALKING_G2: Final = 0.002
"""Variance of the vertical acceleration of the slowest walk: 0.045 g."""
HELD_DEG: Final = 14.0
"""Standard deviation, between people, of how they hold a device."""
BLUR_DEG: Final = 9.0
"""Standard deviation of the direction at full coherence; it grows with its inverse."""
SWINGING: Final = 0.9
"""rad/s; a limb that swings turns faster, a device carried along with the body slower (0.3 to 0.9 in a hand)."""
NARROW: Final = 0.6
"""Share of it by which the part along the line must exceed the part across: (a² − b²)/(a² + b²)."""
SWUNG_DEG: Final = 25.0
"""Standard deviation of a swing's line from the direction of walking (ours: nothing at hand measures it)."""
WIDEST_DEG: Final = 45.0
"""A wider uncertainty says nothing: no heading."""
SETTLING: Final = 100
"""Samples of a stretch before it has one."""

EVERY: Final = 5
"""A heading is taken at each grid index that is a multiple of this."""
KEPT: Final = 128
"""Headings kept: 12.8 s, longer than a step waits to be confirmed."""

# The flat state: orientation, then
MEAN: Final = orientation.SIZE  # of north, east, up acceleration (g) over SWAY_S
H_NORTH: Final = MEAN + 3  # the sample before, its mean removed
H_EAST: Final = MEAN + 4
U1: Final = MEAN + 5  # up, one and two samples ago
U2: Final = MEAN + 6
P: Final = MEAN + 7  # north, east
Q: Final = MEAN + 9  # without 1/ω
UU: Final = MEAN + 11  # means of u², u′², h²
DD: Final = MEAN + 12
HH: Final = MEAN + 13
AXIS: Final = MEAN + 14  # means of north² − east² and 2 north east
STRAY: Final = MEAN + 16  # mean deviation of the field's norm, µT
LEVEL: Final = MEAN + 17  # mean of the field's horizontal part, µT
TURNING: Final = MEAN + 18  # mean square of the angular rate, rad²/s²
SIZE: Final = MEAN + 19

_MEMORY: Final = DT_S / MEMORY_S
_SWAY: Final = DT_S / SWAY_S

State = MutableSequence[float]
Found = tuple[float, float, float]


class WalkingDirection:
    """The heading of one device's wearer, from block to block; blocks without all three sensors give none."""

    def __init__(self) -> None:
        self._state = [0.0] * SIZE
        self._next = -1
        self._first = -1
        self._ring: list[Found | None] = [None] * KEPT
        self._newest = -1
        """Number (grid index / EVERY) of the newest heading in the ring."""

    def update(self, block: SampleBlock) -> None:
        """Go on over `block`."""
        if block.gyro_rad_s is None or block.mag_ut is None or len(block) == 0:
            return
        s, k = self._state, block.start
        for sample in zip(*block.acc_g, *block.gyro_rad_s, *block.mag_ut, strict=True):
            if k != self._next:
                self._begin(k, sample)
            else:
                advance(s, *sample)
            k += 1
            self._next = k
            if k % EVERY == 0:
                self._keep(k // EVERY, heading(s) if k - self._first > SETTLING else None)
                if s[HH] != s[HH] or s[LEVEL] != s[LEVEL]:  # NaN would stay
                    self._next = -1

    def at(self, at_s: float) -> Heading | None:
        """Return the heading at device time `at_s`, from samples before it; None where there is none."""
        number = int(at_s * GRID_HZ + 0.5) // EVERY
        if number < 0 or not 0 <= self._newest - number < KEPT:
            return None
        found = self._ring[number % KEPT]
        return Heading(deg=found[0], uncertainty_deg=found[1], is_line=found[2] > 0.0) if found else None

    def snapshot(self) -> dict[str, Any]:
        """Return the state as plain data."""
        ring = [list(entry) if entry else None for entry in self._ring]
        return {"state": list(self._state), "place": [self._next, self._first, self._newest], "ring": ring}

    def restore(self, state: dict[str, Any]) -> None:
        """Take over a snapshot's state."""
        self._state = list(state["state"])
        self._next, self._first, self._newest = state["place"]
        self._ring = [(entry[0], entry[1], entry[2]) if entry else None for entry in state["ring"]]

    def _begin(self, k: int, sample: tuple[float, ...]) -> None:
        ax, ay, az, _, _, _, mx, my, mz = sample
        s = self._state
        s[:] = [0.0] * SIZE
        orientation.begin(s, 0, ax, ay, az, mx, my, mz)
        self._first = k

    def _keep(self, number: int, found: Found | None) -> None:
        """Put a heading in its place; those left out before it are none."""
        for missed in range(max(self._newest + 1, number - KEPT + 1), number):
            self._ring[missed % KEPT] = None
        self._ring[number % KEPT] = found
        self._newest = number


def advance(
    s: State,
    ax: float,
    ay: float,
    az: float,
    wx: float,
    wy: float,
    wz: float,
    mx: float,
    my: float,
    mz: float,
) -> None:
    """Go on by one grid sample of acceleration (g), angular rate (rad/s) and field (µT)."""
    orientation.advance(s, 0, ax, ay, az, wx, wy, wz, mx, my, mz)
    ux, uy, uz = s[0], s[1], s[2]
    north, east = orientation.horizontal(s, 0, ax, ay, az)
    up = ax * ux + ay * uy + az * uz - 1.0
    for axis, value in ((0, north), (1, east), (2, up)):
        s[MEAN + axis] += _SWAY * (value - s[MEAN + axis])
    north, east, up = north - s[MEAN], east - s[MEAN + 1], up - s[MEAN + 2]
    _turn(s, DT_S * (wx * ux + wy * uy + wz * uz))
    change = 0.5 * (up - s[U2])  # of the sample before
    h_north, h_east, u = s[H_NORTH], s[H_EAST], s[U1]
    s[P] += _MEMORY * (h_north * u - s[P])
    s[P + 1] += _MEMORY * (h_east * u - s[P + 1])
    s[Q] += _MEMORY * (h_north * change - s[Q])
    s[Q + 1] += _MEMORY * (h_east * change - s[Q + 1])
    s[UU] += _MEMORY * (u * u - s[UU])
    s[DD] += _MEMORY * (change * change - s[DD])
    s[HH] += _MEMORY * (h_north * h_north + h_east * h_east - s[HH])
    s[AXIS] += _MEMORY * (h_north * h_north - h_east * h_east - s[AXIS])
    s[AXIS + 1] += _MEMORY * (2.0 * h_north * h_east - s[AXIS + 1])
    s[H_NORTH], s[H_EAST], s[U2], s[U1] = north, east, u, up
    stray = sqrt(mx * mx + my * my + mz * mz) - s[orientation.FIELD]
    level, _ = orientation.horizontal(s, 0, mx, my, mz)
    s[STRAY] += _MEMORY * (abs(stray) - s[STRAY])
    s[TURNING] += _MEMORY * (wx * wx + wy * wy + wz * wz - s[TURNING])
    s[LEVEL] += _MEMORY * (level - s[LEVEL])


def heading(s: State) -> Found | None:
    """Return the direction in degrees clockwise from magnetic north, its uncertainty, and 1 if it is a line only."""
    if not (s[UU] > WALKING_G2 and s[DD] > 0.0 and s[LEVEL] > 0.0):
        return None
    swings = s[TURNING] > SWINGING * SWINGING
    found = _swing(s) if swings else _push(s)
    return None if found is None else _known(s, *found, 1.0 if swings else 0.0)


def _push(s: State) -> tuple[float, float] | None:
    """Return the direction (rad) that goes with the vertical acceleration and its uncertainty (°), front settled."""
    omega = sqrt(s[DD] / s[UU])
    p_n, p_e, q_n, q_e = s[P], s[P + 1], s[Q] / omega, s[Q + 1] / omega
    nn, ee, ne = p_n * p_n + q_n * q_n, p_e * p_e + q_e * q_e, p_n * p_e + q_n * q_e
    line = 0.5 * atan2(2.0 * ne, nn - ee)
    spread = sqrt((nn - ee) * (nn - ee) + 4.0 * ne * ne)
    square = 0.5 * (nn + ee + spread)
    c, d = cos(line), sin(line)
    front = cos(atan2(q_n * c + q_e * d, p_n * c + p_e * d) - FORWARD)
    if not square >= COHERENT * COHERENT * s[UU] * s[HH] or abs(front) < SETTLED:
        return None
    blur = BLUR_DEG * sqrt(s[UU] * s[HH] / square)
    return line if front > 0.0 else line + pi, sqrt(HELD_DEG * HELD_DEG + blur * blur)


def _swing(s: State) -> tuple[float, float] | None:
    """Return the line (rad) along which an arm swings and its uncertainty (°), where one clearly does."""
    spread = sqrt(s[AXIS] * s[AXIS] + s[AXIS + 1] * s[AXIS + 1])
    if spread < NARROW * s[HH]:
        return None
    return 0.5 * atan2(s[AXIS + 1], s[AXIS]), SWUNG_DEG


def _known(s: State, direction: float, uncertainty_deg: float, line: float) -> Found | None:
    field = degrees(atan2(s[STRAY], s[LEVEL]))
    uncertainty_deg = sqrt(uncertainty_deg * uncertainty_deg + field * field)
    if uncertainty_deg > WIDEST_DEG:
        return None
    return degrees(direction) % (180.0 if line else 360.0), uncertainty_deg, line


def _turn(s: State, by: float) -> None:
    """Turn the means with the body, `by` radians about the vertical, counter-clockwise seen from above."""
    c, d = cos(by), sin(by)
    for at in (P, Q):
        north, east = s[at], s[at + 1]
        s[at], s[at + 1] = c * north + d * east, c * east - d * north
    c, d = c * c - d * d, 2.0 * c * d  # twice the angle
    along, across = s[AXIS], s[AXIS + 1]
    s[AXIS], s[AXIS + 1] = c * along + d * across, c * across - d * along
