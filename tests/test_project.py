"""Promises of the project as a whole: what lies where, what is packed, what is pinned and what is documented."""

import dataclasses
import re
import subprocess
import sys
import tomllib
from fnmatch import fnmatch
from importlib import metadata, resources
from pathlib import Path

import pytest
from conftest import missing
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from service.config import Settings

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
README = (ROOT / "README.md").read_text("utf-8")
GUIDE = "".join(path.read_text("utf-8") for path in sorted((ROOT / "service" / "guide").glob("*.md")))
START = "python3 -m venv .venv && .venv/bin/pip install . && .venv/bin/steplink demo"
TEST = "python3 -m venv .venv && .venv/bin/pip install '.[test]' && .venv/bin/pytest"
TOP_LEVEL = {
    "pyproject.toml", "service", "device_sim", "tests", "docker", "README.md", "LICENSE", "CHANGELOG.md",
}  # fmt: skip
PRIVATE = re.compile(  # in pieces, so that this file does not hold what it forbids
    r"(?<![\w./}-])/" + r"work\b"
    "|" + r"(?<![\w.}-])/" + r"tmp/v\b"
    "|" + "/opt/" + "(pypi|wheels)"
    "|" + "pypi" + r"\.org"
    "|" + "pythonhosted" + r"\.org"
)
"""Paths of a workplace, and hosts of a package index: no file may depend on either."""


@pytest.fixture(scope="module")
def tracked() -> list[str]:
    """The files that git tracks, relative to the root."""
    if not (ROOT / ".git").exists():
        missing("this is no git checkout")
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [name for name in listing.split("\0") if name and (ROOT / name).exists()]


# What lies where


def test_the_top_level_holds_only_what_was_agreed(tracked):
    top = {name.split("/")[0] for name in tracked}
    assert {name for name in top if not name.startswith(".")} == TOP_LEVEL


def test_every_folder_of_code_is_a_package(tracked):
    folders = {str(Path(name).parent) for name in tracked if re.match(r"(service|device_sim)/.*\.py$", name)}
    assert {folder for folder in folders if f"{folder}/__init__.py" not in tracked} == set()


def test_no_file_names_a_workplace_or_a_package_index(tracked):
    found = [
        f"{name}: {match.group()}"
        for name in tracked
        if (match := PRIVATE.search((ROOT / name).read_bytes().decode("utf-8", "replace")))
    ]
    assert found == []


@pytest.mark.parametrize("text", ["cd /" + "work/main", "'/" + "tmp/v/bin/python'", "files.pythonhosted" + ".org"])
def test_a_workplace_or_a_package_index_would_be_found(text):
    assert PRIVATE.search(text)


@pytest.mark.parametrize("text", ["network/working", "tests/work/x", "a/tmp/value"])
def test_an_innocent_path_would_not_be_found(text):
    assert PRIVATE.search(text) is None


# What is packed


def packed(package: str, name: str) -> bool:
    """Tell whether `name`, relative to its package, goes into the wheel."""
    return name.endswith(".py") or any(
        fnmatch(name, pattern) and name.count("/") == pattern.count("/")
        for pattern in PROJECT["tool"]["setuptools"]["package-data"][package]
    )


def test_every_file_of_the_packages_goes_into_the_wheel(tracked):
    inside = [name.split("/", 1) for name in tracked if name.startswith(("service/", "device_sim/"))]
    assert [f"{package}/{name}" for package, name in inside if not packed(package, name)] == []


@pytest.mark.parametrize("name", ["py.typed", "api/web/index.html", "api/web/app.js"])
def test_package_data_is_found_where_the_project_is_installed(name):
    assert resources.files("service").joinpath(name).is_file()


def test_the_version_is_in_the_changelog_or_still_to_be():
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert re.search(rf"^## \[({re.escape(PROJECT['project']['version'])}|Unreleased)\]", changelog, re.MULTILINE)


# What is pinned


def constraints() -> dict[str, str]:
    """Return the pinned version of each canonical name, in the file's order."""
    lines = (ROOT / "docker" / "constraints.txt").read_text("utf-8").splitlines()
    pins = [re.fullmatch(r"([a-z0-9-]+)==([a-z0-9.]+)", line) for line in lines if line and not line.startswith("#")]
    assert None not in pins, "a line is not name==version, in canonical form"
    return {pin[1]: pin[2] for pin in pins if pin}


def requirements() -> list[Requirement]:
    """Return every direct requirement: the base's and each extra's."""
    extras = PROJECT["project"]["optional-dependencies"].values()
    return [Requirement(text) for group in (PROJECT["project"]["dependencies"], *extras) for text in group]


def closure(name: str, extras: set[str], seen: set[tuple[str, frozenset[str]]]) -> set[str]:
    """Return the names of all that the installed `name` with `extras` needs on this machine."""
    key = (canonicalize_name(name), frozenset(extras))
    if key in seen:
        return set()
    seen.add(key)
    names = {key[0]}
    for text in metadata.requires(name) or ():
        needed = Requirement(text)
        if needed.marker is None or any(needed.marker.evaluate({"extra": extra}) for extra in {*extras, ""}):
            names |= closure(needed.name, needed.extras, seen)
    return names


def test_constraints_are_in_order():
    assert list(constraints()) == sorted(constraints())


@pytest.mark.parametrize("needed", requirements(), ids=str)
def test_a_constraint_satisfies_each_requirement(needed):
    assert needed.specifier.contains(constraints()[canonicalize_name(needed.name)])


@pytest.mark.full
@pytest.mark.skipif(
    sys.platform != "linux" or sys.version_info[:2] != (3, 11), reason="the constraints are for Linux and Python 3.11"
)
def test_constraints_name_what_requirements_need_in_turn():
    assert closure("steplink", {"fast", "test"}, set()) - {"steplink"} - set(constraints()) == set()


# What is documented


@pytest.mark.parametrize("command", [START, TEST])
def test_the_readme_starts_with_its_two_commands(command):
    blocks = re.findall(r"^```sh\n(.*?)\n```$", README, re.DOTALL | re.MULTILINE)
    assert command in blocks[:2]


@pytest.mark.parametrize("field", dataclasses.fields(Settings), ids=lambda field: field.name)
def test_every_option_is_documented_as_its_help_says(field):
    assert field.metadata["text"]
    said = " ".join(field.default) if isinstance(field.default, tuple) else field.default
    default = "none" if said == "" else f"`{said}`"
    row = f"| `--{field.name.replace('_', '-')}` | {default} | {field.metadata['text']} |"
    assert row in README + GUIDE


def test_every_link_of_the_readme_leads_somewhere(tracked):
    shown = re.sub(r"<!--.*?-->", "", README, flags=re.DOTALL)
    links = [link for link in re.findall(r"\]\(([^)#\s]+)", shown) if "://" not in link]
    assert len(links) > 2
    assert [link for link in links if link not in tracked] == []
