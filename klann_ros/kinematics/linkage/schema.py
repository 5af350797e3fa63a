"""What a linkage's file must look like: `schema.json`, and its complaints in plain words."""

from functools import cache
from importlib import resources
import json
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import best_match


def complaint(content: Any) -> str:
    """Return what is wrong with a file's content, and where; empty when nothing is."""
    error = best_match(_validator().iter_errors(content))
    if error is None:
        return ''
    place = ''.join(f'[{k}]' if isinstance(k, int) else f'.{k}' for k in error.absolute_path)
    text = error.message
    if error.validator == 'not':
        text = 'bend and brace exclude each other'
    elif error.validator == 'pattern':
        text = f'{error.instance!r} is no name: letters, digits and _, a letter first'
    return f'{place.lstrip(".")}: {text}' if place else text


@cache
def _validator() -> Draft202012Validator:
    schema = resources.files('klann_ros.kinematics.linkage') / 'schema.json'
    return Draft202012Validator(json.loads(schema.read_text(encoding='utf-8')))
