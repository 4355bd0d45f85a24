"""Weights of steplink's counter: files that are taken, files that are refused, and whose snapshots go together."""

import numpy as np
import pytest

from service.counters import registry, steplink, steplink_weights
from service.counters.steplink_network import BIAS_LIMIT, WEIGHT_LIMIT
from service.errors import ParameterError, SnapshotError
from service.samples import SampleBlock

LOAD_MS = 50.0


@pytest.fixture(autouse=True)
def _none_named(monkeypatch):
    monkeypatch.delenv(steplink_weights.ENVIRONMENT, raising=False)


@pytest.fixture
def arrays():
    """The shipped integers."""
    return steplink_weights.integers(steplink_weights.shipped().weights)


@pytest.fixture
def other(arrays, tmp_path):
    """A file of other weights: one bias is one more."""
    changed = arrays["bias8"].copy()
    changed[0] += 1
    path = tmp_path / "other.npz"
    path.write_bytes(steplink_weights.packed(arrays | {"bias8": changed}, {"steps": 7}))
    return path


def test_a_file_gives_back_what_was_put_in(arrays, other):
    kept = steplink_weights.read(other)
    again = steplink_weights.integers(kept.weights)
    assert {name: values.dtype for name, values in again.items()} == dict.fromkeys(arrays, np.dtype(np.int32))
    assert again["bias8"][0] == arrays["bias8"][0] + 1
    assert all(np.array_equal(again[name], arrays[name]) for name in arrays if name != "bias8")
    assert kept.about == {"steps": 7}


def test_the_same_weights_are_the_same_bytes(arrays):
    assert steplink_weights.packed(arrays, {"a": 1, "b": 2}) == steplink_weights.packed(arrays, {"b": 2, "a": 1})


def test_the_shipped_file_is_small_and_as_it_would_be_written_now(arrays):
    kept = steplink_weights.shipped()
    assert len(steplink_weights.packed(arrays, kept.about)) < steplink_weights.LARGEST_BYTES
    assert len(steplink_weights.digest(kept.weights)) == steplink_weights.DIGEST_LENGTH


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kernel3": None}, "kernel3 is missing"),
        ({"bias0": np.zeros(12)}, "bias0 is not of integers"),
        ({"bias0": np.zeros(13, np.int32)}, "layer 0 is"),
        ({"bias0": np.full(12, int(BIAS_LIMIT) + 1)}, "bias0 passes"),
        ({"kernel8": np.full((24, 2), -int(WEIGHT_LIMIT) - 1)}, "kernel8 passes"),
        ({"about": np.frombuffer(b"not JSON", np.uint8)}, "no weights"),
        ({"more": np.zeros(100_000, np.int32)}, "larger than"),
    ],
)
def test_a_network_that_is_not_ours_is_refused(arrays, tmp_path, change, said):
    path = tmp_path / "bad.npz"
    np.savez(path, **{name: values for name, values in (arrays | change).items() if values is not None})
    with pytest.raises(ParameterError, match=said):
        steplink_weights.read(path)


def test_another_file_is_refused(tmp_path):
    path = tmp_path / "bad.npz"
    whole = steplink_weights.packed(steplink_weights.integers(steplink_weights.shipped().weights), {})
    (tmp_path / "one.npy").write_bytes(b"")
    np.save(tmp_path / "one.npy", np.zeros(3))
    for content in (b"", b"text", b"t,x,y,z\n0,0,0,1\n", whole[:-30], (tmp_path / "one.npy").read_bytes()):
        path.write_bytes(content)
        with pytest.raises(ParameterError, match="no weights of `steplink train`"):
            steplink_weights.read(path)


def test_a_damaged_file_is_refused(arrays, tmp_path):
    whole = bytearray(steplink_weights.packed(arrays, {}))
    whole[len(whole) // 2] ^= 0xFF
    path = tmp_path / "bad.npz"
    path.write_bytes(whole)
    with pytest.raises(ParameterError, match="no weights"):
        steplink_weights.read(path)


def test_a_file_of_python_objects_is_not_run(arrays, tmp_path):
    path = tmp_path / "bad.npz"
    np.savez(path, **(arrays | {"bias0": np.array([{}] * 12)}))
    with pytest.raises(ParameterError, match="no weights"):
        steplink_weights.read(path)


def test_a_missing_file_is_told():
    with pytest.raises(ParameterError, match=r"nowhere\.npz.*No such file"):
        steplink_weights.use("nowhere.npz")


def test_the_process_counts_with_the_file_it_is_told(other, monkeypatch):
    monkeypatch.setenv(steplink_weights.ENVIRONMENT, "")
    before = registry.make("steplink").snapshot()["params"]
    steplink_weights.use(str(other))
    assert registry.make("steplink").snapshot()["params"] != before
    steplink_weights.use("")
    assert steplink_weights.digest(steplink_weights.in_use()) == steplink_weights.digest(
        steplink_weights.read(other).weights
    )


def test_what_the_environment_names_must_be_weights(tmp_path, monkeypatch):
    monkeypatch.setenv(steplink_weights.ENVIRONMENT, str(tmp_path / "none.npz"))
    with pytest.raises(ParameterError, match=r"none\.npz"):
        steplink_weights.use("")


def test_a_snapshot_of_other_weights_is_refused(other):
    ours, theirs = steplink.build(), steplink.SteplinkCounter(weights=steplink_weights.read(other).weights)
    ours.update(SampleBlock(start=0, acc_g=([0.0] * 30, [0.0] * 30, [1.0] * 30)))
    with pytest.raises(SnapshotError, match="params"):
        theirs.restore(ours.snapshot())
    steplink.build().restore(ours.snapshot())


def test_the_weights_load_at_once():
    from service.evaluation.bench import best_s

    assert 1e3 * best_s(steplink_weights.unpacked) <= LOAD_MS
