"""Material made for tests: walks of known steps, and rest, of several people and sets."""

import numpy as np
from evaluation.made import walk

from service.evaluation.training.material import Material


def material(source="mine", subject="s1", *, seconds=20.0, true_steps=None, timed=True, **changes):
    """A plain walk; rest where it holds no step."""
    recording = walk(seconds)
    holds = len(recording.step_t_s) if true_steps is None else true_steps
    still = np.tile([0.0, 0.0, 1.0], (len(recording.acc_g), 1))
    made = {
        "source": source,
        "subject": subject,
        "placement": "wrist",
        "activity": "walk" if holds else "desk",
        "acc_g": recording.acc_g if holds else still,
        "true_steps": holds,
        "step_s": recording.step_t_s if timed and holds else None,
        "recording": f"{source} {subject}",
    }
    return Material(**(made | changes))
