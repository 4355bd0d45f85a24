"""Which recordings teach, which only measure and which are not looked at: the data sets we know, and what is found.

The shipped weights learn only from sets whose licence is stated and suits (all but UNSTATED); the others are the honest
test of a source that never taught. AUXILIARY sets are kept for the very end: training neither learns from them nor
looks at them, and so it is with what an `index.csv` lists with another split than dev. Sets of no name here are
somebody's own: they teach, and whoever trains answers for their licence.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from service.errors import ParameterError
from service.evaluation.choices import Found
from service.evaluation.scorecard import splits
from service.evaluation.training.material import EXERCISES, SYNTHETIC, UNSTATED, Material, material, true_steps
from service.recordings import read

AUXILIARY: Final = frozenset({"oxford_opt_B", "sensorwatch_magonly", "voisard_lowback"})
WHY: Final = """\
The network learns only from sets whose licence is stated and allows it (of `negatives_banglejs` it is for a part of
the recordings). The others, where they are listed, measure: they are the test of a source that never taught. They were
looked at, with the rest, while thresholds and shares were chosen. Sets kept for the end are neither learnt from nor
looked at while anything is still being chosen."""
"""What the model card says under its table."""

SHORTEST_S: Final = 3.0
"""A shorter recording holds no walk, and fills no clip."""
UNSAID: Final = "unknown"
"""`subject` of a recording that does not say."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A data set: what it holds, where it is from, its licence, and the origin it shares with others."""

    holds: str
    origin: str
    licence: str
    group: str = ""

    def name(self, dataset: str) -> str:
        """Return what is held out as one source: the origin, where several sets share one."""
        return self.group or dataset


KNOWN: Final = MappingProxyType(
    {
        "banglejs_walk": Source(
            holds="wrist, slow and normal walks, weak arm swing",
            origin="dariosalvi78/banglejs-algos-tester, gfwilliams/step-count",
            licence="MIT",
            group="banglejs",
        ),
        "negatives_banglejs": Source(
            holds="wrist, driving, desk work, rest",
            origin="as banglejs_walk",
            licence="MIT, of some recordings none stated",
            group="banglejs",
        ),
        "negatives_spar_watch": Source(
            holds="wrist, seven shoulder exercises",
            origin="SPAR, Burns 2018, in the package seglearn",
            licence="BSD, of the package",
        ),
        "negatives_hmp": Source(
            holds="wrist, household; getting up, lying and sitting down",
            origin="Bruno et al., UCI ADL with a wrist-worn accelerometer",
            licence="CC BY 4.0",
        ),
        "oxford_opt": Source(
            holds="phone in hand, pockets, pouch, bag, armband",
            origin="Oxford-step-counter/DataSet",
            licence="CC BY 4.0",
        ),
        "pebble_wrist": Source(
            holds="wrist, walks, a run; driving, dishes, reading",
            origin="coredevices/PebbleOS, test fixtures",
            licence="Apache-2.0",
        ),
        "dcaiti": Source(
            holds="phone in hand or pocket, walk, stand, stairs", origin="joclement/step-detector", licence="Apache-2.0"
        ),
        "eth2023_wrist": Source(
            holds="wrist, walk, run, arm motion with few steps",
            origin="ETH Zürich, course Mobile Health and Activity Monitoring 2023",
            licence="none stated",
        ),
        "eth2022_wrist": Source(
            holds="wrist, jog, run, stairs, random hand motion", origin="the same course, 2022", licence="none stated"
        ),
        "brajdic_walk": Source(
            holds="phones in hand, pockets, bag, backpack; three speeds",
            origin="Brajdic and Harle, UbiComp 2013",
            licence="not stated in the copies",
            group="brajdic",
        ),
        "brajdic_handling": Source(
            holds="the same phones before and after each walk",
            origin="as brajdic_walk",
            licence="not stated in the copies",
            group="brajdic",
        ),
        "voisard_lowback": Source(
            holds="lower back, walk and turn", origin="IPOL 2023/497", licence="AGPL-3.0, which does not suit"
        ),
        "oxford_opt_B": Source(
            holds="as oxford_opt, and a swinging hand", origin="as oxford_opt", licence="CC BY 4.0", group="oxford_opt"
        ),
        "sensorwatch_magonly": Source(
            holds="wrist, magnitude only: very slow to fast walks; desk, dishwasher, dressing",
            origin="rieck/stepcounter-devel",
            licence="MIT",
        ),
        SYNTHETIC: Source(
            holds="wrist, synthetic walks", origin="`device_sim` of this project", licence="as this project's"
        ),
        EXERCISES: Source(
            holds="wrist, synthetic arm motion without a step, a minute each",
            origin="`motion.exercise` of this project",
            licence="as this project's",
        ),
    }
)
OWN: Final = Source(
    holds="somebody's own recordings", origin="own", licence="not known here: whoever trained answers for it"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sorted:
    """Files told apart: they teach, they only measure (`unseen`), they are not looked at (`apart`)."""

    teaching: Sequence[Found]
    unseen: Sequence[Found]
    apart: Sequence[Found]

    def notes(self) -> list[str]:
        """Return what a user should know of what does not teach."""
        told = []
        if self.unseen:
            told.append(
                f"{_sets(self.unseen)}: the licence is not stated or does not suit, so they teach nothing and are the"
                " test of unseen sources"
            )
        if self.apart:
            told.append(f"{_sets(self.apart)}: kept for the end, neither learnt from nor looked at")
        return told


def source(dataset: str) -> Source:
    """Return what is known of a data set."""
    return KNOWN.get(dataset, OWN)


def told_apart(found: Sequence[Found]) -> Sorted:
    """Tell files apart by their data set and by their index; ParameterError where nothing is left that teaches."""
    looked_at, apart = splits.of_split(found, splits.DEFAULT)
    late = [file for file in looked_at if file.dataset in AUXILIARY]
    taken = [file for file in looked_at if file.dataset not in AUXILIARY]
    made = Sorted(
        teaching=[file for file in taken if file.dataset not in UNSTATED],
        unseen=[file for file in taken if file.dataset in UNSTATED],
        apart=[*apart, *late],
    )
    if not made.teaching:
        raise ParameterError("data", _sets(found), f"nothing there may teach. {'. '.join(made.notes())}")
    return made


def load(
    found: Sequence[Found], lsb_per_g: float, progress: Callable[[int, int], None] = lambda _done, _total: None
) -> tuple[list[Material], list[str]]:
    """Read recordings; return those that say how many steps they hold, and the names of those that do not.

    Too short ones are among the latter. RecordingError where a file is damaged.
    """
    made, passed = [], []
    for number, file in enumerate(found):
        recording = read(file.path, lsb_per_g=lsb_per_g, mapping=file.mapping, rate_hz=file.rate_hz)
        if true_steps(recording) is None or recording.duration_s < SHORTEST_S:
            passed.append(file.shown)
        else:
            made.append(material(file.dataset, recording))
        progress(number + 1, len(found))
    return made, passed


def _sets(found: Sequence[Found]) -> str:
    return ", ".join(sorted({file.dataset for file in found}))
