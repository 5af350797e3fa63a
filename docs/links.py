"""Links of a site of static files: where they lead, and what its pages load."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
import re
from urllib.parse import unquote, urlsplit

# Attributes of what a page loads, which must be files of the site.
LOADING = {'img': 'src', 'script': 'src', 'link': 'href', 'source': 'src', 'object': 'data'}
# Links of the head that only name a place.
NAMING = {'canonical', 'alternate'}
CSS_LINK = re.compile(r'url\(["\']?([^"\')]+)')


@dataclass
class Page:
    """The names in a page, where its links lead, and what it loads."""

    names: set[str] = field(default_factory=set)
    links: set[str] = field(default_factory=set)
    loaded: set[str] = field(default_factory=set)


class PageReader(HTMLParser):
    """A reader of a page's names and links."""

    def __init__(self) -> None:
        super().__init__()
        self.page = Page()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take an element."""
        attributes = {name: text or '' for name, text in attrs}
        self.page.names |= {attributes[name] for name in ('id', 'name') if name in attributes}
        loading = LOADING.get(tag)
        if loading in attributes and attributes.get('rel') not in NAMING:
            self.page.loaded.add(attributes[loading])
        if tag == 'a' and 'href' in attributes:
            self.page.links.add(attributes['href'])


class Site:
    """The pages of a folder."""

    def __init__(self, folder: Path) -> None:
        self.root = folder.resolve()
        self.pages = {}
        for file in sorted(self.root.rglob('*.html')):
            reader = PageReader()
            reader.feed(file.read_text(encoding='utf-8'))
            self.pages[file] = reader.page

    def broken_links(self) -> Iterator[str]:
        """Yield a line for each broken link, and for each thing that is loaded from outside."""
        for file, page in self.pages.items():
            name = file.relative_to(self.root)
            yield from (f'{name} loads {link}' for link in page.loaded if _is_outside(link))
            for link in sorted(page.links | page.loaded):
                if not _is_outside(link) and not self.is_place(file, link):
                    yield f'{name}: broken link {link}'
        for file in sorted(self.root.rglob('*.css')):
            for link in CSS_LINK.findall(file.read_text(encoding='utf-8')):
                if _is_outside(link):
                    yield f'{file.relative_to(self.root)} loads {link}'

    def is_place(self, file: Path, link: str) -> bool:
        """Return whether a link of a page leads to a file of the site, and to a name in it."""
        parts = urlsplit(link)
        if parts.scheme == 'data':
            return True
        target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
        if not target.is_file() or self.root not in target.parents:
            return False
        # A fragment of the lab is its state.
        has_names = target in self.pages and target.name != 'lab.html'
        fragment = unquote(parts.fragment)
        return not fragment or not has_names or fragment in self.pages[target].names


def _is_outside(link: str) -> bool:
    parts = urlsplit(link)
    return bool(parts.netloc) or parts.scheme not in {'', 'data'}
