"""The modules of examples/hardware_driver."""

from importlib import import_module
from pathlib import Path
import sys

DRIVER = Path(__file__).resolve().parents[2] / 'examples' / 'hardware_driver'

sys.path.insert(0, str(DRIVER))
try:
    serial_motors = import_module('serial_motors')
finally:
    sys.path.remove(str(DRIVER))
