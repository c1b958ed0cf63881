"""Commands and options in README, guides and tutorials exist in the program."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from config.errors import RidDaqError
from rid_daq.command_line import operation_command
from rid_daq.command_line.operation_command import OperationCommand
from rid_daq.command_line.root import Root, command_words
from rid_daq.operations.catalogue import operation
from tests.builders.code_lines import ROOT
from tests.builders.console_blocks import PROGRAM, console_steps, program_arguments

GUIDES = sorted((ROOT / "docs" / "guide").glob("*.md"))
PAGES = [ROOT / "README.md", *GUIDES, *sorted((ROOT / "docs" / "tutorial").glob("*.md"))]
EACH_GUIDE = pytest.mark.parametrize("page", GUIDES, ids=lambda page: page.stem)
EACH_PAGE = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
PARTS = ("What you need", "What can go wrong", "Next")
OF_A_SCRIPT = {"--unsigned"}
"""Options of scripts in the repository."""
NO_COMMANDS = ("rid-daq re", "rid-daq points 1")
"""A word that is completed, and the first line of a protocol."""


@pytest.fixture
def root(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Root:
    """Return the command line with commands that check their arguments and do nothing."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SHELL", "/bin/bash")  # --show-completion and --install-completion read it
    (tmp_path / "motion.yaml").touch()  # some options apply to motion files only
    for function in ("perform", "send", "require_memory"):
        monkeypatch.setattr(operation_command, function, lambda *_arguments: None)
    return Root()


def check_command(root: Root, arguments: list[str]) -> None:
    """Check a command line; `--help` and similar options end it before the command runs."""
    with root.make_context(PROGRAM, arguments) as context:
        root.invoke(context)


def inline(page: Path) -> Iterator[str]:
    """Yield the inline code of a page, without its blocks."""
    text = re.sub(r"^ *```.*?^ *```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    text = re.sub(r"^    .*$", "", text, flags=re.M)
    for found in re.findall(r"`([^`]+)`", text):
        yield " ".join(found.split())


def options() -> set[str]:
    """Return every option of the program."""
    root = Root()
    found: list[click.Command] = [
        root, *(OperationCommand(operation(" ".join(words))) for words in command_words())
    ]  # fmt: skip
    parameters = [each for command in found for each in command.get_params(click.Context(command))]
    return {name for each in parameters for name in (*each.opts, *each.secondary_opts)}


@EACH_PAGE
def test_a_command_on_a_page_is_accepted_by_the_program(page: Path, root: Root) -> None:
    for step in console_steps(page):
        for arguments in program_arguments(step.command):
            try:
                check_command(root, arguments)
            except click.exceptions.Exit:
                continue
            except (click.ClickException, RidDaqError) as error:
                raise AssertionError(f"{step.place}: {step.command}") from error


@EACH_PAGE
def test_a_command_in_a_sentence_has_existing_words_and_options(page: Path, root: Root) -> None:
    for text in inline(page):
        if not re.match(rf"{PROGRAM} [a-z-]", text) or text in NO_COMMANDS:
            continue
        for arguments in program_arguments(text.replace("…", "")):
            try:
                check_command(root, arguments)
            except (click.MissingParameter, click.BadOptionUsage, click.exceptions.Exit):
                continue  # a sentence may omit values
            except (click.ClickException, RidDaqError) as error:
                raise AssertionError(f"{page.name}: {text}") from error


@EACH_PAGE
def test_an_option_in_a_sentence_exists(page: Path) -> None:
    named = {
        word
        for text in inline(page)
        if text.startswith("--")
        for word in re.findall(r"(?<!\S)--[a-z][a-z0-9-]*", text)
    }
    assert not named - options() - OF_A_SCRIPT


@EACH_PAGE
def test_commands_are_in_console_blocks(page: Path) -> None:
    text = re.sub(r"^ *```.*?^ *```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    assert not re.findall(rf"^ {{4,}}(?:\$ |(?:\S*/)?{PROGRAM} ).*$", text, re.M)


@EACH_GUIDE
def test_a_guide_has_the_required_sections(page: Path) -> None:
    titles = re.findall(r"^## (.+)$", page.read_text(encoding="utf-8"), re.M)
    parts = [part for title in titles for part in PARTS if title.split(":")[0] == part]
    assert parts == list(PARTS)
    assert titles[-1] == "Next"


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("recrod ir361 motion.yaml", click.UsageError),
        ("record ir361 motion.yaml --paec 1", click.NoSuchOption),
        ("record ir361 motion.yaml --pace fast", RidDaqError),
    ],
)
def test_a_mistake_in_a_command_is_detected(root: Root, line: str, error: type[Exception]) -> None:
    with pytest.raises(error):
        check_command(root, line.split())
