"""The numbers of a training, where whoever tells of them reads them too: the command's help and the model card."""

from __future__ import annotations

from typing import Final

BATCH: Final = 24
STEPS: Final = 3000
HIGHEST_RATE: Final = 4e-3
DECAY: Final = 1e-3
EXACT_FROM: Final = 0.5
"""Share of the steps after which rounding begins."""
AVERAGED: Final = 0.99
"""Share of the running mean of the weights that stays at each step; the mean is what ships."""

WEARERS: Final = 32
"""Synthetic walkers that teach beside the recordings."""
ARMS: Final = 300
"""Minutes of synthetic arm motion without a step that do."""

TUNING_STEPS: Final = 120
TUNING_RATE: Final = 5e-4
"""Of a fine-tuning: an eighth of the usual highest rate, for a twenty-fifth of the steps. Ours."""
