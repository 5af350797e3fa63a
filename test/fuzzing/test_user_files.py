"""Some files that are hostile in one place; `scripts/fuzz --law file` makes thousands of them."""

from fuzzing.programs import check_program
from fuzzing.readers import check_file, READERS
import pytest

FILES, PROGRAMS = 400, 40
PART = 100


@pytest.mark.parametrize('name', READERS)
def test_every_sample_is_taken(name, tmp_path):
    reader = READERS[name]
    path = tmp_path / f'file{reader.ending}'
    for text in reader.texts:
        path.write_text(text)
        reader.read(path)


@pytest.mark.parametrize('first', range(0, FILES, PART))
def test_a_hostile_file_is_read_or_refused_in_a_line(first, tmp_path):
    for seed in range(first, first + PART):
        check_file(None, seed, tmp_path / str(seed))


@pytest.mark.slow
def test_a_program_does_its_work_with_a_hostile_file_or_refuses_it(tmp_path):
    for seed in range(PROGRAMS):
        check_program(None, seed, tmp_path / str(seed))
