"""What is printed reaches whoever reads it, and a reader that has gone ends nothing."""

import io
import os
from contextlib import contextmanager

import pytest

from service.cli import main
from service.cli_output import say, spell_out


@contextmanager
def nobody_reading(monkeypatch):
    """Standard output as a pipe whose reader has left."""
    reads, writes = os.pipe()
    os.close(reads)
    with os.fdopen(writes, "w", encoding="utf-8") as out, monkeypatch.context() as patch:
        patch.setattr("sys.stdout", out)
        yield


def test_a_reader_that_has_gone_is_told_once_and_the_rest_is_silence(monkeypatch):
    with nobody_reading(monkeypatch):
        assert not say("one")
        assert say("two")


def test_a_command_whose_reader_has_gone_ends_as_usual(monkeypatch, capfd):
    with nobody_reading(monkeypatch):
        assert main(["counters", "double_threshold"]) == 0
    assert capfd.readouterr().err == ""


def test_what_is_read_is_printed_at_once(capfd):
    assert say("one")
    assert capfd.readouterr().out == "one\n"


def test_letters_that_a_terminal_lacks_end_nothing(monkeypatch):
    raw = io.BytesIO()
    with io.TextIOWrapper(raw, encoding="ascii", newline="\n") as out:
        monkeypatch.setattr("sys.stdout", out)
        with pytest.raises(UnicodeEncodeError):
            say("3 − 1")
        spell_out()
        assert say("3 − 1")
        assert raw.getvalue() == b"3 ? 1\n"
