"""`CertificatePage`: pages with a head, a foot, and text of any characters."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Final

import matplotlib
from fpdf import FPDF
from fpdf.enums import TableBordersLayout, XPos, YPos
from fpdf.fonts import FontFace, TTFFont

SANS: Final = "DejaVu Sans"
MONO: Final = "DejaVu Sans Mono"
MARGIN_MM: Final = 18.0
TEXT_PT: Final = 9.0
SMALL_PT: Final = 7.5
GREY: Final = (95, 95, 95)
RED: Final = (176, 0, 0)
GREEN: Final = (0, 104, 55)
BLACK: Final = (0, 0, 0)
LINE: Final = (170, 170, 170)

_PAGES: Final = "\ue000"  # no text has it: `plain` writes its number
_HEAD_MM: Final = 20.0
_FONTS: Final = (
    (SANS, "", "DejaVuSans.ttf"),
    (SANS, "B", "DejaVuSans-Bold.ttf"),
    (MONO, "", "DejaVuSansMono.ttf"),
)


class CertificatePage(FPDF):
    """A4 pages of a certificate; the same calls give the same bytes.

    Parameters
    ----------
    subject : str
        What the certificate is of, for the foot of every page.
    simulated : bool
        Whether every page says in large letters that the cell is simulated.
    dated : datetime
        The document's date.
    """

    def __init__(self, subject: str, simulated: bool, dated: datetime) -> None:
        super().__init__(format="A4", unit="mm")
        self._subject = subject
        self._simulated = simulated
        folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        for family, style, name in _FONTS:
            self.add_font(family, style, folder / name)
        fonts = [font for font in self.fonts.values() if isinstance(font, TTFFont)]
        self._drawn = frozenset.intersection(*(frozenset(font.cmap) for font in fonts[:2]))
        self.alias_nb_pages(_PAGES)
        self.set_creation_date(dated)
        self.set_margins(MARGIN_MM, _HEAD_MM if simulated else MARGIN_MM, MARGIN_MM)
        self.set_auto_page_break(True, margin=MARGIN_MM)
        self.lacks_characters = False
        self.text_font()

    def text_font(self, style: str = "", size_pt: float = TEXT_PT) -> None:
        """Write black text of a size from now on."""
        self.set_font(SANS, style, size_pt)
        self.set_text_color(*BLACK)

    def plain(self, text: str) -> str:
        """Return a text as the font can show it: what it lacks becomes its Unicode number."""
        shown = []
        for character in text:
            if character.isspace():
                shown.append(" ")
            elif character.isprintable() and ord(character) in self._drawn:
                shown.append(character)
            else:
                self.lacks_characters = True
                shown.append(f"[U+{ord(character):04X}]")
        return "".join(shown)

    def header(self) -> None:
        """Say on every page of a simulated cell that it is one."""
        if not self._simulated:
            return
        self.set_y(7.0)
        self.set_font(SANS, "B", 26.0)
        self.set_text_color(*RED)
        self.cell(0.0, 10.0, "SIMULATED", align="C", new_x=XPos.LMARGIN, new_y=YPos.NEXT)
        self.text_font()
        self.set_y(_HEAD_MM)

    def footer(self) -> None:
        """Say what the page belongs to, and its number."""
        self.set_y(-12.0)
        self.set_font(SANS, "", SMALL_PT)
        self.set_text_color(*GREY)
        self.cell(0.0, 4.0, self._subject)
        self.set_x(self.l_margin)
        self.cell(0.0, 4.0, f"page {self.page_no()} of {self.str_alias_nb_pages}", align="R")

    def heading(self, text: str, room_mm: float = 25.0) -> None:
        """Begin a section, on the next page where less than `room_mm` are left on this one."""
        if self.will_page_break(room_mm):
            self.add_page()
        self.ln(3.5)
        self.text_font("B", 11.0)
        self.cell(0.0, 6.0, text, new_x=XPos.LMARGIN, new_y=YPos.NEXT)
        self.text_font()

    def sentence(
        self, text: str, size_pt: float = TEXT_PT, colour: tuple[int, int, int] = BLACK
    ) -> None:
        """Write a paragraph."""
        self.text_font(size_pt=size_pt)
        self.set_text_color(*colour)
        self.multi_cell(
            0.0, 0.5 * size_pt, self.plain(text), align="L", new_x=XPos.LMARGIN, new_y=YPos.NEXT
        )
        self.text_font()

    def rows(
        self,
        widths: Sequence[float],
        rows: Sequence[Sequence[str]],
        *,
        head: Sequence[str] = (),
        aligned: str = "",
        size_pt: float = TEXT_PT,
        mono: Sequence[int] = (),
    ) -> None:
        """Write a table.

        Parameters
        ----------
        widths : sequence of float
            Of its columns, as shares of the page.
        rows : sequence of sequence of str
            What stands in it.
        head : sequence of str
            Names of its columns; repeated on the next page.
        aligned : str
            L or R for every column; all left if not given.
        size_pt : float
            Size of the text.
        mono : sequence of int
            The columns whose letters are all of one width.
        """
        self.text_font(size_pt=size_pt)
        self.set_draw_color(*LINE)
        with self.table(
            col_widths=tuple(widths),
            text_align=tuple(
                {"L": "LEFT", "R": "RIGHT"}[each] for each in aligned or "L" * len(widths)
            ),
            borders_layout=TableBordersLayout.HORIZONTAL_LINES,
            headings_style=FontFace(emphasis="BOLD"),
            first_row_as_headings=bool(head),
            line_height=0.5 * size_pt,
            padding=(0.4, 1.2),
        ) as table:
            for cells in (head, *rows) if head else rows:
                row = table.row()
                for column, text in enumerate(cells):
                    style = FontFace(family=MONO) if column in mono and cells is not head else None
                    row.cell(self.plain(text), style=style)
        self.text_font()
