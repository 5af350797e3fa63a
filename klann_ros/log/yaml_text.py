"""YAML in and out, so that a hostile text is one kind of error and output is always plain."""

from typing import Any

import yaml

# What PyYAML's safe loader raises beside its own errors: on `!!int x`, `!!timestamp x`,
# `!!bool x`, `!!set 1` and on a thousand opening brackets.
_LOADER_ERRORS = (
    yaml.YAMLError,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
)


def load(text: str) -> Any:
    """
    Return the data of a YAML text.

    Raises
    ------
    ValueError
        The text is not YAML; the message is one line.

    """
    try:
        return yaml.safe_load(text)
    except _LOADER_ERRORS as error:
        raise ValueError('not YAML: ' + ' '.join(str(error).split())) from None


def dump(data: object) -> str:
    """Return data as YAML in block style, keys in their own order, without a final newline."""
    text: str = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=10**6)
    return text.rstrip('\n')
