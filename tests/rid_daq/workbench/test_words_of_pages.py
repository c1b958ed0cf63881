"""Pages contain no words of the terminal: exit codes, options, commands, paths of the service."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest

from rid_daq.operations.catalogue import CATALOGUE, operation
from rid_daq.service.api.app import make_api
from rid_daq.service.records import Role
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.workbench.menu import MENU
from rid_daq.workbench.pages import PAGES
from rid_daq.workbench.static_files import static_files
from tests.rid_daq.service.test_api import Api
from tests.rid_daq.workbench.conftest import estimated

OF_TERMINAL = re.compile(
    r"exit code|command[- ]line|\bCtrl|std(out|err|in)\b|current folder|working directory"
    r"|\bin (a|the) terminal|\bpress q\b",
    re.IGNORECASE,
)
OPTION = re.compile(r"(?<![\w-])--[a-z]|\brid-daq [a-z]+ ?[a-z]*\b")
"""Options and commands; `commands.js` shows them as fields and links (data-linked)."""

OUTSIDE = "/settings"
"""Page that describes how to add a cell on the service's computer."""

FALLBACK = "stop-missing"
"""Id of the sentence that is shown if STOP did not load; it names the command for STOP."""

FORMS = [f"/operations/{operation(name).kind}" for name, each in CATALOGUE.items() if each.is_job]
ADDRESSES = [entry.path for entry in MENU] + [
    *("/operations", "/runs/history", "/signals", "/edit/new.yaml", "/edit/cell.yaml", "/runs/RUN"),
    *FORMS,
]
SHOWN_ATTRIBUTES = ("aria-label", "placeholder", "title", "label")
LITERAL = re.compile(r"`[^`]*`|\"[^\"\n]*\"")


class _Texts(HTMLParser):
    """Collects the texts of a page, and those in elements whose options are translated."""

    def __init__(self) -> None:
        super().__init__()
        self.raw: list[str] = []
        self.linked: list[str] = []
        self._open: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.raw += [value for name, value in attrs if name in SHOWN_ATTRIBUTES and value]
        if tag not in ("input", "link", "meta", "br", "img"):
            self._open.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop()[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        tags = {tag for tag, _ in self._open}
        is_hidden = any(attributes.get("id") == FALLBACK for _, attributes in self._open)
        if not is_hidden and not tags & {"script", "style", "code", "pre", "textarea"}:
            is_linked = any("data-linked" in attributes for _, attributes in self._open)
            (self.linked if is_linked else self.raw).append(" ".join(data.split()))


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Api:
    folder = tmp_path_factory.mktemp("words")
    service = CellService(folder, [ServedCell("ir361", 20.0)])
    estimated(service.runs, "spring", 3.0)
    api = Api(service)
    api.app = make_api(service, api.door, PAGES)
    return api


@pytest.mark.parametrize("path", ADDRESSES)
def test_a_page_has_no_words_of_the_terminal(api: Api, path: str) -> None:
    (run,) = (each.name for each in api.service.runs.iterdir())
    answer = api.ask(Role.ADMINISTRATOR, "GET", f"/cells/ir361{path.replace('RUN', run)}")
    texts = _Texts()
    texts.feed(answer.text)
    assert texts.raw
    found = [each for each in texts.raw + texts.linked if OF_TERMINAL.search(each)]
    found += [each for each in texts.raw if OPTION.search(each)]
    found += [each for each in texts.raw + texts.linked if str(api.service.folder) in each]
    assert found == [] or path == OUTSIDE


@pytest.mark.parametrize("name", sorted(n for n in static_files() if n.endswith(".js")))
def test_a_script_has_no_words_of_the_terminal(name: str) -> None:
    lines = static_files()[name].decode().splitlines()
    code = "\n".join(line for line in lines if not line.lstrip().startswith("//"))
    assert [each for each in LITERAL.findall(code) if OF_TERMINAL.search(each)] == []
