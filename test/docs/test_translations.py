"""Notebooks and tables are those of their one source, and both languages of a page agree."""

import ast
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
import re
import runpy

from klann_ros.exercises.variant import texts
import pytest

DOCS = Path(__file__).resolve().parents[2] / 'docs'
TRANSLATIONS = runpy.run_path(str(DOCS / 'translations.py'))
PAGE_NAMES: dict[str, str] = TRANSLATIONS['PAGE_NAMES']
FOLDERS: tuple[Path, ...] = TRANSLATIONS['FOLDERS']
# Both languages of each page.
PAGES = [
    (folder / f'{english}.md', folder / f'{portuguese}.md')
    for folder in FOLDERS
    for english, portuguese in PAGE_NAMES.items()
    if (folder / f'{english}.md').exists()
]
# In Portuguese it has what the courses need.
PARTLY_TRANSLATED = DOCS / 'python.md'
NUMBER = r'(?<![\w.])\d+(?:\.\d+)?'


def test_notebooks_and_tables_are_those_of_their_source() -> None:
    outputs: dict[Path, str] = dict(TRANSLATIONS['outputs']())
    outdated = [path.name for path in outputs if path.read_text('utf-8') != outputs[path]]
    assert outdated == [], 'run python docs/translations.py'
    notebooks = {path for path in outputs if path.suffix == '.ipynb'}
    assert notebooks == {*(DOCS.parent / 'examples' / 'notebooks').glob('*.ipynb')}


def test_every_table_is_in_both_languages_of_a_page() -> None:
    tables: dict[str, str] = TRANSLATIONS['tables']()
    pages = [path.read_text('utf-8') for folder in FOLDERS for path in folder.glob('*.md')]
    used = Counter(name for page in pages for name, _ in TRANSLATIONS['TABLE'].findall(page))
    assert used == dict.fromkeys(tables, 2)
    for path, text in TRANSLATIONS['outputs']():
        assert not {*'«»'} & {*text}, path


def code(text: str, _: str) -> Iterator[str]:
    """Yield the code blocks of a page, those of Python without comments."""
    for language, source in re.findall(r'(?ms)^```(\w+)\n(.*?)^```', text):
        yield ast.dump(ast.parse(source)) if language == 'python' else source


def headings(text: str, _: str) -> Iterator[str]:
    """Yield the levels of the headings, with the number of table rows and paragraphs below."""
    for part in re.split(r'(?m)^(?=#)', re.sub(r'(?ms)^```.*?^```', '', text)):
        level = re.match('#*', part)
        assert level
        yield f'{level[0]} {part.count(chr(10) + "|")} {part.count(chr(10) * 2)}'


def words_in_code(text: str, _: str) -> list[str]:
    return re.findall(r'`([^`]+)`', _prose(text))


def links(text: str, _: str) -> Iterator[str]:
    """Yield the pages and figures that a page refers to, by their English names."""
    names = {**PAGE_NAMES, 'theory': 'teoria'}
    english = {f'{portuguese}.md': f'{name}.md' for name, portuguese in names.items()}
    for target in re.findall(r'\]\(([^)#\s]+)', text):
        folder, _, name = target.rpartition('/')
        yield f'{folder}/{english.get(name, name)}'


def numbers(text: str, language: str) -> list[str]:
    """Return the numbers in the sentences of a page, with decimal points."""
    sentences = re.sub(r'`[^`]+`|\]\([^)]*\)', '', _prose(text))
    thousands, point = (',', r'\.') if language == 'en' else (r'\.', ',')
    sentences = re.sub(rf'(?<=\d){thousands}(?=\d\d\d\b)', '', sentences)
    return re.findall(NUMBER, re.sub(rf'(?<=\d){point}(?=\d)', '.', sentences))


def _prose(text: str) -> str:
    return re.sub(r'(?ms)^```.*?^```|^<!-- table.*?^<!-- end -->', '', text)


@pytest.mark.parametrize('extract', [code, headings, words_in_code, links, numbers])
@pytest.mark.parametrize(
    'paths', PAGES, ids=lambda paths: paths[0].relative_to(DOCS.parent).as_posix()
)
def test_both_languages_of_a_page_have_the_same(
    paths: tuple[Path, Path], extract: Callable[[str, str], Iterator[str]]
) -> None:
    english, portuguese = (path.read_text('utf-8') for path in paths)
    # A sentence has another order in another language.
    there = Counter(extract(english, 'en'))
    here = Counter(extract(portuguese, 'pt'))
    if paths[0] != PARTLY_TRANSLATED:
        assert there - here == here - there == Counter()
    elif extract is not headings:
        assert here - there == Counter()
        assert here.total() >= 0.5 * there.total()


@pytest.mark.parametrize(('language', 'name'), [('en', 'lab'), ('pt', 'laboratorio')])
def test_the_labels_of_the_lab_are_those_of_its_page(language: str, name: str) -> None:
    script = (DOCS.parent / 'klann_ros/web/lab/static/texts.js').read_text('utf-8')
    blocks = dict(re.findall(r'(?ms)^  (en|pt): \{\n(.*?)^  \},', script))
    shown = blocks[language] + str([words[language] for words in texts()['practice'].values()])
    page = re.sub(r'(?ms)^```.*?^```', '', (DOCS / f'{name}.md').read_text('utf-8'))
    labels = re.findall(r'(?<!\*)\*([^*`]+)\*', re.sub(r'\s+', ' ', page))
    assert len(labels) > 10
    assert [label for label in labels if label.removesuffix(' …') not in shown] == []
