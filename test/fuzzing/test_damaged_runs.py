"""Some damaged runs; `scripts/fuzz` makes thousands of them."""

from fuzzing.laws import check, MAX_MEMORY, memory
from fuzzing.samples import make_samples
import pytest

CASES = 108
PART = 27


@pytest.fixture(scope='module')
def samples(tmp_path_factory):
    return make_samples(tmp_path_factory.mktemp('samples'))


@pytest.mark.parametrize('first', range(0, CASES, PART))
def test_any_damage_is_survived_and_what_is_sound_comes_back(samples, tmp_path, first):
    before = memory()
    for seed in range(first, first + PART):
        check(samples[seed % len(samples)], seed, tmp_path / str(seed))
    assert memory() - before < MAX_MEMORY
