"""What a linkage's file must look like: `schema.json`, and its complaints in plain words."""

from collections.abc import Callable
from functools import cache
from importlib import resources
import json
from reprlib import Repr
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import best_match
from klann_ros.sanitize.text import did_you_mean

# What a complaint is about is Any: its types hold a marker for what is not set.
TYPES = {
    'array': 'a list',
    'boolean': 'true or false',
    'number': 'a number',
    'object': 'a mapping',
    'string': 'a text',
}


def complaint(content: Any) -> str:
    """Return what is wrong with a file's content, and where; empty when nothing is."""
    if content is None:
        return f'it is empty: it must have {", ".join([*_schema()["required"], "start"])}'
    error = best_match(Draft202012Validator(_schema()).iter_errors(content))
    if error is None:
        return ''
    place = ''.join(f'[{k}]' if isinstance(k, int) else f'.{k}' for k in error.absolute_path)
    text = _WORDS.get(str(error.validator), _fallback)(error)
    return f'{place.lstrip(".")}: {text}' if place else text


@cache
def _schema() -> dict[str, Any]:
    schema = resources.files('klann_ros.kinematics.linkage') / 'schema.json'
    content: dict[str, Any] = json.loads(schema.read_text(encoding='utf-8'))
    return content


def _shown(instance: Any) -> str:
    shortener = Repr()
    shortener.maxstring = shortener.maxother = shortener.maxlong = 40
    return shortener.repr(instance)


def _missing(error: Any) -> str:
    names = [name for name in error.validator_value if name not in error.instance]
    return f'{", ".join(names)} {"are" if len(names) > 1 else "is"} missing'


def _unknown(error: Any) -> str:
    known = list(error.schema['properties'])
    unknown = [key for key in error.instance if key not in known]
    hint = did_you_mean(unknown[0], known)
    shown = ', '.join(map(_shown, unknown))
    return f'{shown} is unknown here: there can be {", ".join(known)}{hint}'


def _type(error: Any) -> str:
    if 'propertyNames' in error.absolute_schema_path:
        return f'the name {_shown(error.instance)} is no text: write it in quotation marks'
    return f'{_shown(error.instance)} must be {TYPES[error.validator_value]}'


def _name(error: Any) -> str:
    return f'{_shown(error.instance)} is no name: letters, digits and _, a letter first'


def _bound(error: Any) -> str:
    words = {'exclusiveMinimum': '>', 'minimum': '>=', 'maximum': '<='}
    return f'{_shown(error.instance)} must be {words[error.validator]} {error.validator_value:g}'


def _count(error: Any) -> str:
    limits = error.schema
    if limits.get('minItems') == limits.get('maxItems'):
        return f'{_shown(error.instance)} must be [x, y]'
    return f'there must be {limits.get("minItems", limits.get("minProperties"))} or more'


def _choice(error: Any) -> str:
    return f'{_shown(error.instance)} must be one of {", ".join(map(str, error.validator_value))}'


def _fallback(error: Any) -> str:
    return f'{_shown(error.instance)} is not allowed by the rule {error.validator}'


_WORDS: dict[str, Callable[[Any], str]] = {
    'required': _missing,
    'additionalProperties': _unknown,
    'type': _type,
    'pattern': _name,
    'minLength': _name,
    'maxLength': _name,
    'exclusiveMinimum': _bound,
    'minimum': _bound,
    'maximum': _bound,
    'minItems': _count,
    'maxItems': _count,
    'minProperties': _count,
    'enum': _choice,
    'not': lambda _: 'bend and brace exclude each other',
    'anyOf': lambda _: (
        'start is missing: an angle for every body, or in its place assembly: a sign for each dyad'
    ),
}
