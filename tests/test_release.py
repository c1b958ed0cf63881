"""Content of a release, and its use in an environment without other packages."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.builders.code_lines import PACKAGES

ROOT = Path(__file__).resolve().parent.parent
UV = shutil.which("uv") or str(ROOT / ".uv" / "bin" / "uv")  # like ./environment.sh


@pytest.mark.skipif(sys.version_info >= (3, 12), reason="the page is made on Python 3.11")
def test_the_page_of_licences_lists_all_installed_packages() -> None:
    path = ROOT / "release" / "third_party.py"
    spec = importlib.util.spec_from_file_location("third_party", path)
    assert spec is not None
    assert spec.loader is not None
    third_party = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(third_party)
    assert third_party.PAGE.read_text() == third_party.page(), "run release/third_party.py"
    texts = third_party.texts()
    for name in third_party.needed_packages():
        assert f"\n{name} " in texts


def test_a_release_is_signed_or_marked_as_a_trial(tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if k != "RID_DAQ_SIGNING_KEY"}
    done = subprocess.run(
        [ROOT / "release" / "release.sh", tmp_path],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("RID_DAQ_SIGNING_KEY")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def release(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a trial release."""
    folder = tmp_path_factory.mktemp("release") / "new"
    subprocess.run([ROOT / "release" / "release.sh", "--unsigned", folder], check=True)
    return folder


@pytest.mark.long
def test_a_release_contains_the_files_to_install_and_to_verify(release: Path) -> None:
    subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=release, check=True)
    names = {path.name for path in release.iterdir()}
    assert {"Containerfile", "requirements.txt", "THIRD-PARTY-LICENCES.txt"} < names
    pinned, hashed = (
        (release / f"{name}.txt").read_text() for name in ("constraints", "requirements")
    )
    # if one package has a hash, pip and pipx also require a hash of rid-daq's wheel
    assert "--hash" not in pinned
    assert [line for line in pinned.splitlines() if line.split(" ")[0] not in hashed] == []
    bill = json.loads((release / "rid-daq.cdx.json").read_text())
    listed = {each["name"] for each in bill["components"]}
    assert bill["bomFormat"] == "CycloneDX"
    assert {"numpy", "pin", "python-can"} < listed
    assert "pytest" not in listed


@pytest.mark.long
def test_the_wheel_contains_every_file_of_the_packages(release: Path) -> None:
    """From any directory, commands find their files only in the installed wheel."""
    with zipfile.ZipFile(next(release.glob("rid_daq-*.whl"))) as wheel:
        packed = set(wheel.namelist())
    words = ("git", "ls-tree", "-r", "--name-only", "HEAD", *PACKAGES)
    finished = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    kept = set(finished.stdout.splitlines())
    assert len(kept) > 300
    assert kept <= packed
    assert "rid_daq/site/index.html" in packed


@pytest.mark.long
@pytest.mark.parametrize("python", ["python3.11", "python3.12", "python3.13"])
def test_the_wheel_identifies_a_robot_from_an_empty_directory(
    release: Path, python: str, tmp_path: Path
) -> None:
    if not shutil.which(python) or subprocess.run([python, "-c", ""], check=False).returncode:
        pytest.skip(f"{python} is not installed")
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("RID_DAQ", "PYTHON"))}
    fresh = tmp_path / "environment"
    (tmp_path / "empty").mkdir()

    def ran(*command: str | Path) -> str:
        return subprocess.run(
            [str(each) for each in command],
            cwd=tmp_path / "empty",
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        ).stdout

    pip = (UV, "pip", "install", "--quiet", "--python", fresh / "bin" / "python")
    wheel = next(release.glob("rid_daq-*.whl"))
    ran(UV, "venv", "--quiet", "--python", python, fresh)
    ran(*pip, "--require-hashes", "--only-binary", ":all:", "-r", release / "requirements.txt")
    ran(*pip, "--no-deps", wheel)
    program = fresh / "bin" / "rid-daq"
    assert ran(program, "--version").strip() == wheel.name.split("-")[1]
    ran(program, "init", "mine")
    small = ("--method", "two-harmonic", "--period", "4", "--periods", "3")
    ran(program, "design", "mine/cell.yaml", "-o", "motion.yaml", *small)
    ran(program, "record", "mine/cell.yaml", "motion.yaml", "--label", "first")
    found = json.loads(ran(program, "identify", "first", "--json"))
    assert [axis["grade"] for axis in found["estimate"]["axes"]] == ["good"] * 3
    assert Path(tmp_path / "empty" / found["report"]).stat().st_size > 100_000
