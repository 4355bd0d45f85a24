"""Document 000 from its text, a whole recording at once: what the streaming kernel must agree with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

WARM_UP = 5


@dataclass
class Extremum:
    at: int
    value: float
    peak: bool


def smooth(magnitude):
    """(5), the first magnitude standing for those before it."""
    m = [magnitude[0]] * 4 + list(magnitude)
    return [(m[n] + m[n - 1] + m[n - 2] + m[n - 3] + m[n - 4]) / 5.0 for n in range(4, len(m))]


def extrema(x, half):
    """(7), (8): `half` strict rises, then `half` strict falls, or the other way round."""
    found = []
    for n in range(max(half, WARM_UP), len(x) - half):
        before = [x[n - i] - x[n - i - 1] for i in range(half)]
        after = [x[n + i] - x[n + i + 1] for i in range(half)]
        if min(before + after) > 0:
            found.append(Extremum(n, x[n], peak=True))
        elif max(before + after) < 0:
            found.append(Extremum(n, x[n], peak=False))
    return found


def thresholds(found, samples, length, share=0.0):
    """(9) to (16): T_H and T_L = L + share (H − L) of each window of fixed length, None before both means exist."""
    high = low = None
    result = []
    for start in range(0, samples, length):
        inside = [e for e in found if start <= e.at < start + length]
        for peak in (True, False):
            values = [e.value for e in inside if e.peak is peak]
            known = high if peak else low
            if not values:
                continue
            mean = (known + values[0]) / 2.0 if len(values) == 1 and known is not None else np.mean(values)
            high, low = (mean, low) if peak else (high, mean)
        result.append(None if high is None or low is None else ((high + low) / 2.0, low + share * (high - low)))
    return result


def valid_peaks(magnitude, *, half, length, valleys, wait, low, high, share):
    """Return the indices of valid peaks and, apart, of the steps: valid peaks that are no reference."""
    x = smooth(magnitude)
    found = extrema(x, half)
    windows = thresholds(found, len(x), length, share)
    valid, steps = [], []
    for e in found:
        bounds = windows[e.at // length]
        if not e.peak or bounds is None or not e.value > bounds[0]:
            continue
        after = [v for v in found if not v.peak and e.at < v.at <= e.at + wait][:valleys]
        if not any(v.value < bounds[1] for v in after):
            continue
        spacing = e.at - valid[-1] if valid else high
        if spacing <= low:
            continue
        valid.append(e.at)
        if spacing < high:
            steps.append(e.at)
    return valid, steps
