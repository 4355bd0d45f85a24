"""What tests of the evaluation share."""

import pytest


@pytest.fixture(scope="session")
def bare(tmp_path_factory):
    """An environment in which numba is not there: nothing to compile, so it also starts at once."""
    made = tmp_path_factory.mktemp("bare")
    (made / "sitecustomize.py").write_text("import sys\nsys.modules['numba'] = None\n")
    return {"PYTHONPATH": str(made)}
