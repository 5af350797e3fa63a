"""What all pages share: one renderer of legs, its styles, and how a page is put into one file."""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .browser import open_browser, print_page, PrintError
    from .lab.build import LAB_FILE, lab_page
    from .markup import breakable, element, joined, Markup, number, scrolling_table, table_row
    from .parts import FRAME, html_page, Parts, SHARED, text
    from .shape import leg_shape
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
