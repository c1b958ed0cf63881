"""Every package that rid-daq needs has a wheel for each supported Python."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from packaging.markers import Marker
from packaging.tags import Tag, compatible_tags, cpython_tags
from packaging.utils import parse_wheel_filename

ROOT = Path(__file__).resolve().parent.parent
GLIBC_2_28 = [
    *(f"manylinux_2_{minor}_x86_64" for minor in range(5, 29)),
    *("manylinux1_x86_64", "manylinux2010_x86_64", "manylinux2014_x86_64"),
]
"""Platform tags of wheels for Debian 10, Ubuntu 20.04, RHEL 8 and later versions."""


def needed_packages(minor: int) -> list[dict[str, Any]]:
    """Return the locked packages that the program needs on one Python version."""
    locked = tomllib.loads((ROOT / "uv.lock").read_text())["package"]
    environment = {
        "python_full_version": f"3.{minor}.0",
        "python_version": f"3.{minor}",
        "sys_platform": "linux",
        "platform_system": "Linux",
        "platform_machine": "x86_64",
        "platform_python_implementation": "CPython",
        "implementation_name": "cpython",
    }
    found: list[dict[str, Any]] = []
    ours = next(package for package in locked if package["name"] == "rid-daq")
    queue = [*ours["dependencies"]]
    while queue:
        name = queue.pop()
        if "marker" in name and not Marker(name["marker"]).evaluate(environment):
            continue
        package = next(
            each
            for each in locked
            if each["name"] == name["name"]
            and each["version"] == name.get("version", each["version"])
        )
        if package not in found:
            found.append(package)
            queue += package.get("dependencies", [])
    return found


@pytest.mark.parametrize("minor", [11, 12, 13])
def test_only_wheels_are_installed(minor: int) -> None:
    tags: set[Tag] = {
        *cpython_tags((3, minor), platforms=GLIBC_2_28),
        *compatible_tags((3, minor), interpreter=f"cp3{minor}", platforms=GLIBC_2_28),
    }
    packages = needed_packages(minor)
    assert len(packages) > 40
    without = [
        f"{package['name']} {package['version']}"
        for package in packages
        if not any(
            parse_wheel_filename(wheel["url"].rsplit("/", 1)[1])[3] & tags
            for wheel in package.get("wheels", [])
        )
    ]
    assert without == []
