"""Quantities: every usual form is read, in any unit of the same dimension; all else is refused."""

from math import isnan
from pathlib import Path

from klann_ros.sanitize.quantity import read_quantity
import pytest
from yaml_tables import read_table

TABLE = read_table(Path(__file__).with_name('quantities.yaml'))
CASES = [(text, unit, number) for unit, row in TABLE.items() for text, number in row.items()]
HOSTILE = [
    '5' * 10**7,
    f'5{" " * 10**7}',
    f'{"(" * 1000}5 m',
    f'5 {"m/" * 30}m',
    f'5 {"km9" * 20}',
]


@pytest.mark.parametrize(('text', 'unit', 'number'), CASES)
def test_a_quantity_is_read_as_a_person_means_it(
    text: object, unit: str, number: float | None
) -> None:
    reading = read_quantity(str(text), unit)
    if number is None:
        assert reading is None
    else:
        assert reading == pytest.approx(number, rel=1e-9, nan_ok=True)


@pytest.mark.parametrize('text', HOSTILE, ids=range(len(HOSTILE)))
def test_a_hostile_text_is_no_finite_number(text: str) -> None:
    reading = read_quantity(text, 'mm')
    assert reading is None or isnan(reading)
