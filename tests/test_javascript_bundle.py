"""The bundle of third-party JavaScript: pinned packages, reproducible build, licences."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import tarfile
import zipfile
from pathlib import Path

import pytest

from config.errors import ConfigError
from rid_daq.web import bundled_modules
from rid_daq.workbench.static_files import static_files
from tests.builders.code_lines import PACKAGES
from tests.builders.raised_codes import raises_code

ROOT = Path(__file__).resolve().parent.parent
JAVASCRIPT = ROOT / "javascript"
UV = shutil.which("uv") or str(ROOT / ".uv" / "bin" / "uv")  # like ./environment.sh
BUNDLE = ROOT / "rid_daq" / "workbench" / "bundled"


def test_the_lock_file_pins_each_package_by_a_hash_and_names_no_registry() -> None:
    locked = json.loads((JAVASCRIPT / "package-lock.json").read_text())["packages"]
    wanted = json.loads((JAVASCRIPT / "package.json").read_text())["devDependencies"]
    packages = {place: package for place, package in locked.items() if place}
    assert len(packages) > 3
    assert [p for p, each in packages.items() if not each["integrity"].startswith("sha512-")] == []
    assert [p for p, each in packages.items() if "resolved" in each] == []
    assert {name: packages[f"node_modules/{name}"]["version"] for name in wanted} == wanted


def test_the_bundle_was_made_from_the_present_files() -> None:
    """If this fails, run `uv sync`."""
    manifest = json.loads((BUNDLE / "manifest.json").read_text())
    sources = [p for p in JAVASCRIPT.iterdir() if p.suffix in {".js", ".json", ".py"}]
    assert manifest["sources"] == {
        p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sources
    }
    entries = {path.name for path in JAVASCRIPT.glob("*.js")}
    assert set(manifest["files"]) == {*entries, "uplot.css", "licences.txt"}
    licences = (BUNDLE / "licences.txt").read_text()
    for package in manifest["packages"]:
        assert f"\n{package['name']} {package['version']}: {package['licence']}\n" in licences


def test_the_modules_evaluate_no_text_and_load_nothing() -> None:
    """The pages' Content-Security-Policy allows neither `unsafe-eval` nor other hosts."""
    modules = list(BUNDLE.glob("*.js"))
    assert modules
    for path in modules:
        text = path.read_text()
        assert not re.search(r"\beval\(|new Function\(|\bimport\(|\bfrom\s*\"", text), path
        assert "export{" in text.replace(" ", "")


_IMPORT = re.compile(r'import \{([^}]*)\} from "\./([\w.]+)";')
_EXPORT = re.compile(r"^export (?:async )?(?:function|const|let|class) (\w+)", re.MULTILINE)
_EXPORTED = re.compile(r"\bexport ?\{([^}]*)\}")


def exported_names(module: str) -> set[str]:
    lists = [part for listed in _EXPORTED.findall(module) for part in listed.split(",")]
    named = {part.split(" as ")[-1].strip() for part in lists}
    return {*_EXPORT.findall(module), *named} - {""}


def test_every_imported_name_is_exported() -> None:
    """A module that imports a missing name does not run, nor do those that import it."""
    modules = {
        name: content.decode() for name, content in static_files().items() if name.endswith(".js")
    }
    missing = [
        f"{name}: {wanted} of {source}"
        for name, text in modules.items()
        for listed, source in _IMPORT.findall(text)
        for wanted in (part.split(" as ")[0].strip() for part in listed.split(",") if part.strip())
        if wanted not in exported_names(modules[source])
    ]
    assert len(modules) > 20
    assert missing == []


def test_git_contains_no_bundled_file() -> None:
    words = ("git", "ls-files", "rid_daq/workbench/bundled", "*/node_modules/*")
    assert subprocess.run(words, cwd=ROOT, capture_output=True, check=True).stdout == b""


@pytest.mark.parametrize("damage", ["deleted", "changed"])
def test_a_damaged_bundle_is_refused(
    damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copied = tmp_path / "bundled"
    shutil.copytree(BUNDLE, copied)
    monkeypatch.setattr(bundled_modules, "BUNDLE", copied)
    assert "lit.js" in bundled_modules.bundled_modules.__wrapped__()
    if damage == "deleted":
        (copied / "lit.js").unlink()
    else:
        (copied / "lit.js").write_text("export {}")
    with raises_code(ConfigError, "RID-INSTALL-BUNDLE", "lit.js"):
        bundled_modules.bundled_modules.__wrapped__()


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the files from which a release is built, without a bundle."""
    copy = tmp_path_factory.mktemp("project")
    words = ("git", "ls-files", "pyproject.toml", "README.md", "LICENSE", "javascript", *PACKAGES)
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.splitlines():
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, copy / name)
    return copy


def build(
    project: Path, *words: str | Path, registry: str = ""
) -> subprocess.CompletedProcess[str]:
    """Run `uv build` with an empty npm cache, optionally with another npm registry."""
    environment = {**os.environ, "npm_config_cache": str(project / ".npm")}
    if registry:
        environment["npm_config_registry"] = registry
    return subprocess.run(
        [UV, "build", "--out-dir", project / "dist", *words],
        cwd=project,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


NO_REGISTRY = "http://127.0.0.1:9"
"""Address without a registry: port 9 (discard) refuses connections."""


@pytest.mark.slow
def test_a_build_needs_the_registry_once_and_gives_the_same_bytes(project: Path) -> None:
    refused = build(project, "--sdist", registry=NO_REGISTRY)
    assert refused.returncode
    assert "npm_config_registry" in refused.stderr
    assert not list(project.glob("dist/*.gz"))
    assert build(project, "--sdist").returncode == 0
    (source,) = project.glob("dist/*.tar.gz")
    assert (project / "javascript" / "node_modules" / "@typescript").is_dir()
    with tarfile.open(source) as packed_source:
        assert not [name for name in packed_source.getnames() if "node_modules" in name]
    built = build(project, "--wheel", source, registry=NO_REGISTRY)  # the source has the bundle
    assert built.returncode == 0, built.stderr
    with zipfile.ZipFile(next(project.glob("dist/*.whl"))) as wheel:
        assert not [name for name in wheel.namelist() if "javascript" in name]
        packed = {
            Path(name).name: wheel.read(name)
            for name in wheel.namelist()
            if name.startswith("rid_daq/workbench/bundled/")
        }
    assert packed == {path.name: path.read_bytes() for path in BUNDLE.iterdir()}
