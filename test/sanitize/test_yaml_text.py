"""YAML of strangers: whatever it is, it is read at a cost like its length, or refused."""

from contextlib import suppress
from pathlib import Path
from typing import Any

from hypothesis import given, strategies as st
from klann_ros.sanitize import yaml_text
import pytest

LOADERS = pytest.mark.parametrize('load', [yaml_text.load, yaml_text.parse], ids=['log', 'user'])


@LOADERS
@pytest.mark.parametrize('text', ['1:30', '1:30.5', '-190:20:30', '!!int 1:30', '!!float 1:30.5'])
def test_a_number_to_the_base_of_60_is_a_text(load, text) -> None:
    assert load(f'a: {text}') == {'a': text.rpartition(' ')[2]}


@LOADERS
@pytest.mark.parametrize('end', ['', '.5'])
def test_a_long_scalar_is_not_parsed_as_a_number(load, end) -> None:
    text = '1' + ':1' * 50_000 + end
    assert load(f'a: {text}') == {'a': text}


@LOADERS
@pytest.mark.parametrize('tag', ['int', 'float', 'bool', 'binary', 'timestamp', 'omap', 'pairs'])
@given(value=st.text(alphabet='0123456789:.-+eExXabfTZ ~[]{}"', max_size=60))
def test_whatever_stands_behind_a_tag_is_read_or_refused(load, tag, value) -> None:
    with suppress(ValueError):
        load(f'a: !!{tag} {value}')


@LOADERS
@given(value=st.text(alphabet='0123456789:.-+eEx_ ', max_size=400))
def test_whatever_looks_like_a_number_is_read_or_refused(load, value) -> None:
    with suppress(ValueError):
        load(f'a: {value}')


@pytest.mark.parametrize(
    'text', ['', 'é', '\U0001f600', '\x00', '\x85', '\u2028', '\ufeff', '1:30', '- x']
)
@pytest.mark.parametrize('dumper', ['libyaml', 'none'])
def test_written_text_is_read_back(monkeypatch, dumper, text) -> None:
    if dumper == 'none':
        monkeypatch.setattr(yaml_text, '_FastDumper', yaml_text.yaml.SafeDumper)
        # PyYAML's own writes a next line as it stands, which reads as a blank.
        text = text.replace('\x85', '')
    data = {'a': [text, {text: 1e-3}], 'b': {}}
    assert yaml_text.load(yaml_text.dump(data)) == data


def test_half_a_pair_of_surrogates_is_written_escaped() -> None:
    assert yaml_text.dump({'a': '\ud800'}).isascii()


@LOADERS
def test_a_whole_number_beyond_all_floats_is_refused(load) -> None:
    assert load(f'a: 1{"0" * 308}') == {'a': 10**308}
    with pytest.raises(ValueError, match='is no whole number within'):
        load(f'a: 1{"0" * 309}')


def test_nested_aliases_count_as_often_as_they_are_referenced() -> None:
    levels = [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 9)}]' for n in range(1, 8)]
    with pytest.raises(ValueError, match='unfolds to more than 100000 entries'):
        yaml_text.load('\n'.join(['a0: &a0 x', *levels]))
    assert len(yaml_text.load('\n'.join(['a0: &a0 x', *levels[:4]]))) == 5


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('[1, 2]', 'a is missing'),
        ('a: [', 'line 1'),
        (': :', ''),
        ('a: .nan', 'must be a finite number'),
        ('a: 1e400', 'must be a finite number'),
        (f'a: 1{"0" * 309}', 'line 1, column 4: 10000000000000000000... (310 characters) is no'),
        (f'b: 1\na: -{"9" * 5000}', 'line 2, column 4: -9999'),
        (f'a: 0x{"f" * 6000}', 'is no whole number within +-1.8e308'),
        (f'1{"0" * 400}: a', 'is no whole number'),
        ('a: !!int x', 'x is no whole number'),
        ('a: 1\na: 2\n', 'is there twice'),
        ('a: &a [*a]', 'anchor'),
        (f'a: {"[" * 25}{"]" * 25}', 'more than 20 levels'),
        ('\x00', ''),
    ],
)
def test_an_invalid_file_is_refused_in_a_line(tmp_path: Path, text: str, reason: str) -> None:
    def required(content: Any) -> Any:
        if 'a' not in content:
            raise ValueError('a is missing')
        return content

    file = tmp_path / 'file.yaml'
    file.write_text(text)
    with pytest.raises(ArithmeticError) as refused:
        yaml_text.content_of_file(str(file), required, 'letter', ArithmeticError)
    assert str(refused.value).startswith(f'{file} holds no letter: ')
    assert reason in str(refused.value)
    assert '\n' not in str(refused.value)


@pytest.mark.parametrize(
    ('path', 'reason'), [('/dev/zero', 'a device'), ('/', 'a folder'), ('no.yaml', 'No such file')]
)
def test_a_path_without_a_file_is_refused(path: str, reason: str) -> None:
    with pytest.raises(ArithmeticError, match=f'{path} cannot be read: .*{reason}'):
        yaml_text.content_of_file(path, lambda content: content, 'letter', ArithmeticError)


@pytest.mark.parametrize(
    ('text', 'content'),
    [
        ('l_ab: 0.12\n\n---\n', {'l_ab': 0.12}),
        ('---\nl_ab: 0.12\n---\n---\n...\n', {'l_ab': 0.12}),
        ('---\n---\n', None),
        ('', None),
    ],
)
def test_empty_documents_behind_a_text_are_none(text: str, content: object) -> None:
    assert yaml_text.parse(text) == content


@pytest.mark.parametrize('text', ['a: 1\n---\na: 2\n', '---\n---\na: 1\n---\n0\n'])
def test_several_documents_are_refused(text: str) -> None:
    with pytest.raises(
        yaml_text.YamlError, match=r'it holds [23] documents, separated by ---, instead of'
    ):
        yaml_text.parse(text)
