"""Licences of all packages that are installed with rid-daq, or bundled with it.

`python release/third_party.py` writes `docs/reference/third-party.md`, which
`tests/test_release.py` checks. `python release/third_party.py FILE` writes the texts of the
licences to a file. `python release/third_party.py FILE.cdx.json` adds the bundled JavaScript to a
bill of materials of the Python packages.
"""

from __future__ import annotations

import base64
import json
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
BUNDLE = ROOT / "rid_daq" / "workbench" / "bundled"
PAGE = ROOT / "docs" / "reference" / "third-party.md"

_HEAD = """# What is installed with rid-daq, and under which licence

rid-daq itself is under the Apache License 2.0. These packages are installed with it, on Linux. A
release contains the texts of their licences (`THIRD-PARTY-LICENCES.txt`) and a bill of materials
with versions and hashes (CycloneDX). Made by `python release/third_party.py`.

| package | licence |
|---|---|
"""
_HEAD_OF_BUNDLE = """
The pages of the workbench contain parts of these JavaScript packages, which the build takes from
npm ([0070](../decisions/0070-javascript-bundled-at-build-time.md)).

| package | version | licence |
|---|---|---|
"""
_LICENCE_FILE = re.compile(r"(?i)^(licen[cs]e|copying|notice|copyright|lgpl)")


def needed_packages() -> list[str]:
    """Return the packages that rid-daq needs on this computer, from `uv.lock`, sorted."""
    from packaging.markers import Marker

    locked = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))["package"]
    dependencies: dict[str, list[dict[str, Any]]] = {}
    for package in locked:
        dependencies.setdefault(package["name"], []).extend(package.get("dependencies", []))
    found: set[str] = set()
    queue = ["rid-daq"]
    while queue:
        for wanted in dependencies[queue.pop()]:
            applies = "marker" not in wanted or Marker(wanted["marker"]).evaluate()
            if applies and wanted["name"] not in found:
                found.add(wanted["name"])
                queue.append(wanted["name"])
    return sorted(found)


def licence(name: str) -> str:
    """Return the licence of a package according to its metadata."""
    about = metadata.metadata(name).json
    if expression := about.get("license_expression"):
        return str(expression)
    classified = [
        each.rsplit(" :: ", 1)[1]
        for each in about.get("classifier", [])
        if each.startswith("License :: ")
    ]
    written = str(about.get("license", "")).strip()
    if "\n" not in written and 0 < len(written) <= 40:
        return str(written)
    return ", ".join(classified) or "see its licence file"


def bundled() -> list[dict[str, str]]:
    """Return name, version, licence and hash of the JavaScript packages in the bundle."""
    manifest = json.loads((BUNDLE / "manifest.json").read_text(encoding="utf-8"))
    packages: list[dict[str, str]] = manifest["packages"]
    return packages


def page() -> str:
    """Return the page that lists the licences."""
    python = "".join(f"| {name} | {licence(name)} |\n" for name in needed_packages())
    javascript = "".join(
        f"| {each['name']} | {each['version']} | {each['licence']} |\n" for each in bundled()
    )
    return _HEAD + python + _HEAD_OF_BUNDLE + javascript


def texts() -> str:
    """Return the texts of all licences, each with its package's name and version."""
    python = "\n".join(
        f"{'=' * 72}\n{name} {metadata.version(name)}: {licence(name)}\n{'=' * 72}\n{text}"
        for name in needed_packages()
        for text in _texts_of(name)
    )
    return f"{python}\n{(BUNDLE / 'licences.txt').read_text(encoding='utf-8')}"


def add_bundle(bill: dict[str, Any]) -> None:
    """Add the bundled JavaScript packages to the components of a bill of materials (CycloneDX)."""
    for each in bundled():
        digest = base64.b64decode(each["integrity"].removeprefix("sha512-")).hex()
        bill["components"].append(
            {
                "type": "library",
                "bom-ref": f"pkg:npm/{each['name']}@{each['version']}",
                "name": each["name"],
                "version": each["version"],
                "purl": f"pkg:npm/{each['name']}@{each['version']}",
                "hashes": [{"alg": "SHA-512", "content": digest}],
                "licenses": [{"license": {"id": each["licence"]}}],
            }
        )


def _texts_of(name: str) -> Iterator[str]:
    named = [path for path in metadata.files(name) or [] if _LICENCE_FILE.match(path.name)]
    files = [path for path in named if ".dist-info" in str(path)] or named
    for path in files:
        yield path.read_text(encoding="utf-8")
    if not files:
        yield (
            str(metadata.metadata(name).json.get("license", ""))
            or "Its package has no text of its licence."
        ) + "\n"


if __name__ == "__main__":
    if sys.argv[1:] and sys.argv[1].endswith(".cdx.json"):
        path = Path(sys.argv[1])
        complete = json.loads(path.read_text(encoding="utf-8"))
        add_bundle(complete)
        path.write_text(json.dumps(complete, indent=2) + "\n", encoding="utf-8")
    elif sys.argv[1:]:
        Path(sys.argv[1]).write_text(texts(), encoding="utf-8")
    else:
        PAGE.write_text(page(), encoding="utf-8")
