"""
Write what both languages have from one source: python docs/translations.py.

The notebooks are made from examples/notebooks/*.md.in, the tables of the pages from tables.md.in
and the exercises' data. There «English|português» is a text in both languages; a cell of numbers
has a decimal comma in Portuguese. A page has a table between two comments, the first names it.
"""

from collections.abc import Iterator
from itertools import product
import json
from pathlib import Path
import re
from string import Template

from klann_ros.exercises.calculation import data
from klann_ros.exercises.platforms import install_cell
from klann_ros.exercises.variant import texts

DOCS = Path(__file__).resolve().parent
NOTEBOOKS = DOCS.parent / 'examples' / 'notebooks'
# The tables of the courses, which the site puts into their pages, are data of the tests.
FOLDERS = (DOCS, DOCS.parent / 'test' / 'docs')
# File names in English and Portuguese, without their endings.
NOTEBOOK_NAMES = {'sem104_lecture_7': 'sem104_aula_7', 'four_bar': 'quatro_barras'}
PAGE_NAMES = {
    'courses': 'cursos',
    'python': 'python_pt',
    'lab': 'laboratorio',
    'teaching': 'ensino',
    'examples': 'exemplos',
}
LANGUAGES = ('en', 'pt')
BILINGUAL = re.compile(r'«([^«|»]*)\|([^«|»]*)»')
NUMBERS = re.compile(r'(?<=\| )[-\d. ]+(?= \|)')
CODE = re.compile(r'(?ms)^```python\n(.*?)^```\n')
TABLE = re.compile(r'(?ms)^<!-- table (\S+) -->\n(.*?)^<!-- end -->\n')
METADATA = {
    'kernelspec': {'display_name': 'Python 3', 'language': 'python', 'name': 'python3'},
    'language_info': {'name': 'python'},
}


def translate(text: str, language: str) -> str:
    """Return a text in one language."""
    return BILINGUAL.sub(lambda match: match[1 + LANGUAGES.index(language)], text)


def notebook(text: str, language: str) -> str:
    """Return the notebook of a source: its heading, the installation, then its other cells."""
    cells = []
    for k, source in enumerate(CODE.split(translate(text, language))):
        if source.strip():
            cells.append(('code' if k % 2 else 'markdown', source.strip()))
    heading, _, start = cells[0][1].partition('\n\n')
    first_cell = install_cell(language, 'matplotlib', 'matplotlib')
    cells[:1] = [('markdown', heading), ('code', first_cell), ('markdown', start)]
    book = {'cells': [], 'metadata': METADATA, 'nbformat': 4, 'nbformat_minor': 5}
    for k, (kind, source) in enumerate(cells):
        cell = {'cell_type': kind, 'id': f'cell-{k:02}', 'metadata': {}}
        outputs = {'execution_count': None, 'outputs': []} if kind == 'code' else {}
        lines = source.splitlines(keepends=True)
        book['cells'].append({**cell, **outputs, 'source': lines})
    return f'{json.dumps(book, indent=1, ensure_ascii=False)}\n'


def tables() -> dict[str, str]:
    """Return the bilingual tables by their names, with the words of the exercises in them."""
    words = {}
    for slip, description in texts()['slips'].items():
        words[f'slip_{slip}'] = _bilingual(description)
        credit = data()['marking']['credit']
        words[f'credit_{slip}'] = str(credit.get(slip, credit['other']))
    source = Template((DOCS / 'tables.md.in').read_text(encoding='utf-8'))
    return dict(TABLE.findall(source.safe_substitute(words)))


def _bilingual(words: dict[str, str]) -> str:
    return f'«{words["en"]}|{words["pt"]}»'


def page(text: str, language: str) -> str:
    """Return a page with its tables filled in."""
    bilingual_tables = tables()

    def filled(match: re.Match[str]) -> str:
        table = translate(bilingual_tables[match[1]], language)
        if language == 'pt':
            table = NUMBERS.sub(lambda numbers: numbers[0].replace('.', ','), table)
        return f'<!-- table {match[1]} -->\n{table}<!-- end -->\n'

    return TABLE.sub(filled, text)


def outputs() -> Iterator[tuple[Path, str]]:
    """Yield the path and the text of every notebook, and of every page with such tables."""
    for names in NOTEBOOK_NAMES.items():
        source = (NOTEBOOKS / f'{names[0]}.md.in').read_text(encoding='utf-8')
        for name, language in zip(names, LANGUAGES, strict=True):
            yield NOTEBOOKS / f'{name}.ipynb', notebook(source, language)
    for folder, names in product(FOLDERS, PAGE_NAMES.items()):
        for name, language in zip(names, LANGUAGES, strict=True):
            path = folder / f'{name}.md'
            if path.exists():
                yield path, page(path.read_text(encoding='utf-8'), language)


if __name__ == '__main__':
    for path, text in outputs():
        path.write_text(text, encoding='utf-8')
