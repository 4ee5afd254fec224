# SPDX-License-Identifier: MIT
"""What is installed is what is there: Python packages, executables and configuration files."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("nmpc_control", "uav_sim")
LAPTOP = (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def python_packages(name):
    """Return the dotted names of a catkin package's Python packages on disk."""
    source = ROOT / "src" / name / "src"
    return {".".join(p.parent.relative_to(source).parts) for p in source.rglob("__init__.py")}


@pytest.mark.parametrize("name", PACKAGES)
def test_setup_lists_every_python_package(name):
    tree = ast.parse((ROOT / "src" / name / "setup.py").read_text(encoding="utf-8"))
    listed = next(
        k.value for k in ast.walk(tree) if isinstance(k, ast.keyword) and k.arg == "packages"
    )
    assert set(ast.literal_eval(listed)) == python_packages(name)


@pytest.mark.parametrize("name", PACKAGES)
def test_cmake_installs_every_executable(name):
    folder = ROOT / "src" / name
    text = (folder / "CMakeLists.txt").read_text(encoding="utf-8")
    programs = set(re.search(r"PROGRAMS(.*?)DESTINATION", text, re.S).group(1).split())
    on_disk = {p for part in ("nodes", "scripts") for p in (folder / part).iterdir() if p.is_file()}
    assert programs == {str(p.relative_to(folder)) for p in on_disk}


def test_laptop_gets_every_python_package_that_needs_no_ros():
    listed = re.search(r"\[tool\.setuptools\]\npackages = \[(.*?)\]", LAPTOP, re.S).group(1)
    wanted = {p for name in PACKAGES for p in python_packages(name) if ".ros" not in p}
    assert set(re.findall(r'"([\w.]+)"', listed)) == wanted


@pytest.mark.parametrize("name", PACKAGES)
def test_laptop_gets_every_configuration_file(name):
    patterns = re.findall(rf'"(src/{name}/config/[^"]*)"', LAPTOP)
    copied = {path for pattern in patterns for path in ROOT.glob(pattern)}
    assert copied == set((ROOT / "src" / name / "config").rglob("*.yaml"))


@pytest.mark.parametrize("name", ["dji_sdk", "nmpc_msgs"])
def test_every_definition_is_generated(name):
    folder = ROOT / "src" / name
    text = (folder / "CMakeLists.txt").read_text(encoding="utf-8")
    on_disk = {p.name for part in ("msg", "srv", "action") for p in folder.glob(f"{part}/*")}
    assert set(re.findall(r"\w+\.(?:msg|srv|action)\b", text)) == on_disk
