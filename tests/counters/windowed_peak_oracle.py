"""Documents 003 and 000 (1.2.2) from their text, a whole recording at once: what the windowed peaks must agree with."""

from __future__ import annotations

from itertools import pairwise

import numpy as np


def smooth(norm, n):
    padded = [norm[0]] * (n - 1) + list(norm)
    return np.array([np.mean(padded[i : i + n]) for i in range(len(norm))])


def tops(x):
    """Samples that x rises to and falls after."""
    return [k for k in range(1, len(x) - 1) if x[k - 1] < x[k] > x[k + 1]]


def greatest_of_a_window(x, k, window):
    """Whether x[k] is the greatest of some `window` samples in a row that hold it."""
    starts = range(max(k - window + 1, 0), min(k, len(x) - window) + 1)
    return any(x[k] == x[first : first + window].max() for first in starts)


def greatest_beside(x, k, half):
    return k >= half and k + half < len(x) and x[k] == x[k - half : k + half + 1].max()


def score(x, k, half):
    """+1 for each pair that rises before k or falls after it, −1 for the others."""
    left = [1 if a < b else -1 for a, b in pairwise(x[k - half : k + 1])]
    right = [1 if a > b else -1 for a, b in pairwise(x[k : k + half + 1])]
    return sum(left) + sum(right)


def regular(peaks, gait_of, bout=2):
    """Indices of the steps among `peaks`: those from the bout's `bout`-th on; `gait_of(k)` gives shortest, longest."""
    steps, last, in_bout = [], None, 0
    for k in peaks:
        shortest, longest = gait_of(k)
        spacing = None if last is None else k - last
        if spacing is not None and spacing < shortest:
            continue
        in_bout = 1 if spacing is None or spacing > longest else in_bout + 1
        last = k
        if in_bout >= bout:
            steps.append(k)
    return steps
