"""The ring against a plain list of everything that was ever measured."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from device_sim.ring import Ring

actions = st.lists(
    st.one_of(
        st.tuples(st.just("append"), st.integers(0, 30)),
        st.tuples(st.just("send"), st.tuples(st.integers(0, 20), st.integers(1, 10))),
        st.tuples(st.just("drop"), st.integers(0, 40)),
    ),
    max_size=40,
)


@given(capacity=st.integers(1, 20), index=st.integers(0, 2**32), actions=actions)
def test_every_sample_is_held_sent_or_lost(capacity, index, actions):
    ring, all_samples, sent, lost = Ring(capacity, 3, index=index), [], set(), 0
    for action, how in actions:
        if action == "append":
            fresh = [[len(all_samples) + i, -i, 7] for i in range(how)]
            all_samples += fresh
            lost += ring.append(np.array(fresh, dtype=np.int16).reshape(-1, 3))
        elif action == "drop":
            lost += ring.drop(ring.next - how)
        elif how[0] < len(ring):
            first = ring.first + how[0]
            n = min(how[1], ring.next - first)
            places = set(range(first, first + n))
            assert ring.mark_sent(first, n) == len(places - sent)
            sent |= places
        held = range(ring.first, ring.next)
        assert ring.next == index + len(all_samples)
        assert len(ring) <= capacity
        assert ring.read(ring.first, len(ring)).tolist() == all_samples[ring.first - index :][: len(ring)]
        assert ring.unsent == len(set(held) - sent)
        assert len(all_samples) == len(sent) + lost + ring.unsent
