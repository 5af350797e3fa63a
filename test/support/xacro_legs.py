"""URDFs that the xacro makes of parameter files."""

from pathlib import Path
from typing import Any

import xacro

ROOT = Path(__file__).resolve().parents[2]


def urdf_of(params_file: Path, **arguments: str) -> str:
    mappings = {'params_file': str(params_file), **arguments}
    document: Any = xacro.process_file(str(ROOT / 'urdf' / 'klann.urdf.xacro'), mappings=mappings)
    return str(document.toxml())
