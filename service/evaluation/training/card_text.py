"""What the model card says in words; figures are filled in by `card`."""

from __future__ import annotations

from typing import Final

DIGEST_BEFORE: Final = "weights `"
"""What stands before the digest in HEAD."""

HEAD: Final = """\
# Model card: the network of steplink's own counter

Of the weights `{digest}`, written by the `steplink train` that made them; nothing here is written by hand.

The counter `steplink` (see [the counters](counters.md)) asks a convolutional network of {parameters} integer
parameters, for every {frame_s} s of acceleration at {rate_hz} Hz: does somebody walk, and about how fast? It answers
{delay_s} s later, having seen what comes after. Autocorrelation finds the exact cadence, and the cadence summed up over
a walk is the number of steps. The network sees five numbers of the filtered acceleration that do not depend on how the
device is turned; no gyroscope, nothing of the wearer, and nothing leaves the machine it runs on.
"""

USE: Final = """\
## What it is for

Counting the steps of people who walk or run, from one accelerometer worn at a wrist or carried as a phone is: in a
hand, a pocket, a bag, at an arm or around the neck; with few false steps from household, exercise, desk and driving.

It is **not a medical device**: it diagnoses nothing, is not validated for gait analysis, rehabilitation, the detection
of falls or any decision about somebody's health, and must not be used for these. Nor does it tell people apart.
"""

NOT_MEASURED: Final = """\
Nothing was measured in this training: `steplink train --folds sources subjects` measures."""

ABOUT_FIGURES: Final = """\
Counts are those of the counter with the integer weights it ships with, whole recordings on the grid, its tuned
parameters. Walks: mean over recordings of the absolute error in percent of the true steps. The rest holds no step:
false steps an hour (`/h`). `mean of sources` weighs a source of many recordings no more than one of few; `must` and
`aim` are what the project asks of a counter. Where several seeds were trained, the value is their mean, the range in
brackets. *Each source held back* is the hardest test: neither the people nor the sensors nor the places of that source
were learnt from.
"""

RECIPE: Final = """\
{made}

AdamW, one cycle of the learning rate up to {rate}, weight decay {decay}, {batch} clips of {clip_s} s a step. A clip is
pieces of recordings one after the other, so that motion without a step stands between walks. The loss: cross-entropy of
walking where that is known, distance of the steps a second where step times are, and where only the number of steps is
known its relative error. During the last {exact} % of the steps, weights and everything between layers are rounded to
the integers that the counter computes with. What ships is their running mean (of which {averaged} % stays at each
step).

Each piece is changed at random: pace and strength, orientation, gain and offset of axes, noise, the rattle of a loose
strap, rate ({rates} Hz), resolution, a range of ±{range_g} g, stretches lost; and recordings at the body are hung on a
synthetic arm that swings.

How often a piece is of a source:
"""

LIMITS: Final = """\
- **Cadence** can be told from {slowest} to {fastest} steps a second. In the recordings learnt from that have step times
  it is {walked} (5 and 95 % of the steps). Slower shuffling may be refused, and running faster than 3.2 steps a second
  is not known to be right.
- **Few steps**: a walk is certain from {least} steps on, and only if what follows looks like one; of synthetic walkers
  who stood before and after, those of up to five steps were not counted. Nor are single steps about a kitchen.
- **Not in the data**, as far as the sets say: children, wheelchairs, walking frames, sticks and crutches, treadmills,
  prams and trolleys, gait changed by illness or injury, devices at the ankle, the foot or the chest. Counts there are
  not known to be right; try them against steps you have counted.
- **Who**: {people} people or accounts of {sources} sources. Of most of them neither age, sex, height nor health is
  known, so nothing can be said of differences between groups.
- **Few runs**: running at the wrist rests on a handful of recordings and on synthetic runners.
- **Mistaken for walking**: motion of an arm that is as regular as a walk and in its rhythm, as of some exercises or
  combing hair, and getting up or lying down.
- **Mistaken for no walk**: a wrist held still (a phone call, a rail, a trolley) on somebody who walks softly.
- **Truth**: of several sets the steps were counted by the wearer or are a round number; a count may be off by a few.
- **Late**: the steps of a walk's start are told in retrospect, up to {latency_s} s after they happened.

Where your recordings differ from these, count the steps of some and see: `steplink evaluate`, then
[train it further](training.md) and be told whether that helped.
"""
