"""Some runs and files of each law; `scripts/fuzz` makes thousands of them."""

from fuzzing.laws import check, check_cost, check_legal, MAX_MEMORY, memory
from fuzzing.samples import make_samples
import pytest

CASES = 44
PART = 22


@pytest.fixture(scope='module')
def samples(tmp_path_factory):
    return make_samples(tmp_path_factory.mktemp('samples'))


@pytest.mark.parametrize('first', range(0, CASES, PART))
def test_any_damage_is_survived_and_intact_messages_are_recovered(samples, tmp_path, first):
    before = memory()
    for seed in range(first, first + PART):
        check(samples[seed % len(samples)], seed, tmp_path / str(seed))
    assert memory() - before < MAX_MEMORY


@pytest.mark.slow
def test_legal_variants_are_read_without_loss(tmp_path):
    for seed in range(CASES):
        check_legal(None, seed, tmp_path / str(seed))


def test_any_pattern_costs_work_in_proportion(tmp_path):
    for seed in range(CASES):
        check_cost(None, seed, tmp_path / str(seed))
