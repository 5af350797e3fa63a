"""Definitions of installed message types as others write them."""

from pathlib import Path
import re
import sys


def idl_definition(type_name: str) -> str:
    """Return an installed type's definition as rosbag2 stores IDL: each file once."""
    files: dict[str, str] = {}

    def collect(package: str, name: str) -> None:
        if f'{package}/msg/{name}' not in files:
            text = Path(sys.prefix, 'share', package, 'msg', f'{name}.idl').read_text()
            files[f'{package}/msg/{name}'] = text
            for package_, name_ in re.findall(r'#include "(\w+)/msg/(\w+).idl"', text):
                collect(package_, name_)

    package, _, name = type_name.split('/')
    collect(package, name)
    return ''.join(f'{"=" * 80}\nIDL: {name}\n{text}\n' for name, text in files.items())
