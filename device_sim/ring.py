"""The bracelet's memory: its newest samples, by number, and which of them have been sent.

A full ring overwrites its oldest sample. One that was overwritten before it was ever sent is lost: nobody can have it
any more. Numbers are unwrapped here; a packet carries their low 32 bits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int16]


class Ring:
    """At most `capacity` samples of `columns` values, the first numbered `index`."""

    def __init__(self, capacity: int, columns: int, *, index: int = 0) -> None:
        self.first = self.next = index
        """Numbers of the oldest sample held, and of the one that comes next."""
        self._samples: Counts = np.empty((capacity, columns), dtype=np.int16)
        self._sent = np.zeros(capacity, dtype=np.bool_)

    def __len__(self) -> int:
        return self.next - self.first

    @property
    def unsent(self) -> int:
        """How many samples are held that were never sent."""
        return self._unsent(len(self))

    def append(self, samples: Counts) -> int:
        """Keep more samples; return how many were lost for that."""
        capacity = len(self._samples)
        skipped = max(0, len(samples) - capacity)
        overwritten = min(len(self), max(0, len(self) + len(samples) - capacity))
        lost = skipped + self._unsent(overwritten)
        kept = samples[skipped:]
        places = self._places(self.next + skipped, len(kept))
        self._samples[places] = kept
        self._sent[places] = False
        self.next += len(samples)
        self.first = max(self.first, self.next - capacity)
        return lost

    def read(self, first: int, n: int) -> Counts:
        """Return `n` samples from `first` on, all of which are held."""
        return self._samples[self._places(first, n)]

    def mark_sent(self, first: int, n: int) -> int:
        """Note that samples were sent; return how many of them for the first time."""
        places = self._places(first, n)
        fresh = n - int(self._sent[places].sum())
        self._sent[places] = True
        return fresh

    def drop(self, before: int) -> int:
        """Let go of the samples before number `before`; return how many were lost for that."""
        gone = min(len(self), max(0, before - self.first))
        lost = self._unsent(gone)
        self.first += gone
        return lost

    def _unsent(self, oldest: int) -> int:
        """Return how many of the oldest samples were never sent."""
        return oldest - int(self._sent[self._places(self.first, oldest)].sum())

    def _places(self, first: int, n: int) -> NDArray[np.int64]:
        return np.arange(first, first + n) % len(self._samples)
