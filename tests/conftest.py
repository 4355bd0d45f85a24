"""What every test may ask for: the recordings, and what STEPLINK_REQUIRE makes of a missing tool."""

import os
from pathlib import Path
from typing import NoReturn

import pytest
from hypothesis import HealthCheck, settings

# A loaded machine is no failure; and CI tries the same examples every time, developers new ones.
settings.register_profile(
    "steplink", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=os.environ.get("CI") == "true"
)
settings.load_profile("steplink")


def missing(what: str) -> NoReturn:
    """Skip for a missing tool or data set; fail instead where STEPLINK_REQUIRE=all promises that all is there."""
    if os.environ.get("STEPLINK_REQUIRE") == "all":
        pytest.fail(f"STEPLINK_REQUIRE=all, but {what}")
    pytest.skip(what)


@pytest.fixture(autouse=True)
def _own_data_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a service that is told no file store in the test's own folder, not in the user's."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings that STEPLINK_DATA names."""
    path = os.environ.get("STEPLINK_DATA")
    if not path or not Path(path).is_dir():
        missing("STEPLINK_DATA names no folder of recordings")
    return Path(path)
