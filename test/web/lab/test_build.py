"""The page that is installed is the one that its parts make."""

from base64 import b85decode
import json
import re
import zlib

from klann_ros.exercises.lab import lab_data
from klann_ros.kinematics import SHIPPED, shipped_linkages
from klann_ros.sanitize.yaml_text import parse, parse_file
from klann_ros.web.lab.build import LAB_FILE, lab_page

PACKED = re.compile('(?<=<script id="packed" type="text/plain">)[^<]+')


def unpacked(page: str) -> str:
    """Return a page with the practice mode as it was before each zlib packed it its own way."""
    return PACKED.sub(
        lambda match: zlib.decompress(b85decode(match[0].replace('.', '<'))).decode(), page
    )


def test_the_file_is_up_to_date() -> None:
    message = 'python -m klann_ros.exercises.lab writes it anew'
    page = unpacked(LAB_FILE.read_text(encoding='utf-8'))
    assert 'class Practice' in page
    assert page == unpacked(lab_page(lab_data())), message


def test_it_is_small_enough_to_be_passed_on() -> None:
    assert LAB_FILE.stat().st_size < 300_000


def test_its_linkages_are_the_shipped_ones() -> None:
    page = LAB_FILE.read_text(encoding='utf-8')
    (texts,) = re.findall('<script id="data" type="application/json">(.*?)</script>', page)
    shipped = {name: parse(text) for name, text in json.loads(texts).items()}
    assert shipped == {name: parse_file(SHIPPED / f'{name}.yaml') for name in shipped_linkages()}


def test_licences_of_vendored_code_are_included() -> None:
    page = LAB_FILE.read_text(encoding='utf-8')
    assert 'Copyright (C) 2011-2015 by Vitaly Puzrin' in page
    assert 'WITHOUT WARRANTY OF ANY KIND' in page
