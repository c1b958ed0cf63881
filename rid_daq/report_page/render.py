"""`render_report`: renders a result as one self-contained HTML page."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterable, Iterator

import jinja2
from markupsafe import Markup

from config.errors import RecordingError
from rid_daq.blocks.block import AnyBlock
from rid_daq.blocks.formats import duration, format_utc, number
from rid_daq.blocks.plot import Plot
from rid_daq.report.certificate import Certificate
from rid_daq.report.model_file import BY_MODEL
from rid_daq.report.result import Result
from rid_daq.report.section_blocks.certificate import certificate_evidence, certified_values
from rid_daq.report.section_blocks.sections import BLOCKS_BY_SECTION
from rid_daq.report.section_blocks.verdict import check_tables
from rid_daq.report_page.drawings.page_colours import colours
from rid_daq.report_page.live_figures import LiveFigures, library, library_style, script
from rid_daq.terminal.console import make_printable


def render_report(
    result: Result,
    before: Result | None = None,
    robot: Iterable[AnyBlock] = (),
    head: Iterable[AnyBlock] = (),
) -> str:
    """Return the report of a result as HTML.

    All numbers are those of the result. All texts from outside the program are escaped.

    Args:
        result: The result to show; sections that it does not contain are left out.
        before: The result in the run's file; None without a file. Sections of `result` that are
            equal in `before` were read from that file.
        robot: Blocks that show the robot; they follow the sections.
        head: Blocks that identify the run; they precede the sections.

    Raises:
        RecordingError: A section contains numbers that cannot be shown.
    """
    figures = LiveFigures()
    parts = []
    for name, section in result.sections():
        with _named_in_errors(name, read=getattr(before, name, None) == section):
            parts.append(_part(name, BLOCKS_BY_SECTION[name](section), figures))
            parts.append(_origin(result, name))
    with _named_in_errors("the document", read=before is not None):
        page = _environment().get_template("page.html")
        simulated = result.cell is not None and result.cell.simulated
        checks = _part("verdict", check_tables(result.verdict), figures)
        parts.append(_part("robot", robot, figures))
        return page.render(
            result=result,
            signed_parts=[_part("head", head, figures), checks],
            parts=parts,
            figures=figures,
            simulated=simulated,
            name="Name",
            is_certificate=False,
        )


def render_certificate(certificate: Certificate) -> str:
    """Return the certificate of a payload as an HTML page; equal contents give equal bytes."""
    robot = certificate.payload.estimate.robot.name
    result = Result.new("rid-daq payload certificate", robot).with_sections(
        verdict=certificate.verdict, software=certificate.folder.software, cell=certificate.cell
    )
    values = [
        _part("verdict", check_tables(certificate.verdict), None),
        _part("certificate", certified_values(certificate), None),
    ]
    return (
        _environment()
        .get_template("page.html")
        .render(
            result=result,
            signed_parts=values,
            parts=[_part("evidence", certificate_evidence(certificate), None)],
            figures=LiveFigures(),
            simulated=certificate.simulated,
            name=certificate.by or "Name",
            is_certificate=True,
        )
    )


def load_templates() -> None:
    """Compile the templates of all pages in advance; otherwise the first page compiles them."""
    for name in _environment().list_templates(extensions=["html"]):
        _environment().get_template(name)


def _part(name: str, blocks: Iterable[AnyBlock], figures: LiveFigures | None) -> Markup:
    """Return a part of the page; if `figures` is None, plots are not interactive."""
    template = _environment().get_template("blocks.html")
    live = (lambda *_of: "") if figures is None else figures.add
    return Markup(template.render(blocks=list(blocks), name=name, live=live))


def _origin(result: Result, name: str) -> Markup:
    """Return the model of a section as HTML, and its time if the sections differ in theirs."""
    model = str(result.model) if result.model is not None and name in BY_MODEL else ""
    made = {} if result.timing is None else result.timing.made or {}
    time = format_utc(made[name]) if name in made and len(set(made.values())) > 1 else ""
    words = ", ".join(filter(None, (model, time)))
    return Markup('<p class="soft">{}.</p>').format(words) if words else Markup()


@functools.cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("rid_daq.report_page"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=_visible,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    for show in (number, duration, format_utc):
        environment.filters[show.__name__] = show
    for function in (_plot_svg, colours, library, library_style, script):
        environment.globals[function.__name__] = function
    return environment


def _plot_svg(plot: Plot, name: str) -> Markup:
    """Return the drawing of a plot as SVG; the first call imports matplotlib."""
    from rid_daq.report_page.drawings.plot import plot_svg

    return plot_svg(plot, name)


def _visible(value: object) -> object:
    """Return the value of a template's expression with visible control characters."""
    return make_printable(value) if type(value) is str else value


@contextlib.contextmanager
def _named_in_errors(section: str, *, read: bool) -> Iterator[None]:
    """Name the section in an error if it cannot be shown.

    Args:
        read: True if the section was read from a file, which may have been edited.

    Raises:
        RecordingError: The section contains invalid values.
    """
    try:
        yield
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        TypeError,
        ValueError,
        jinja2.TemplateError,
    ) as error:
        hint = "the file may have been edited" if read else "nothing was written"
        raise RecordingError(
            f"{section}: this section cannot be shown: {error}; {hint}", code="RID-RESULT-UNSOUND"
        ) from error
