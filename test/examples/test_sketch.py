"""The sketch of examples/esp32_driver compiles against declarations of its libraries."""

from pathlib import Path
import re
import subprocess

from motor_board import COMPILER, SKETCH
import pytest

DECLARATIONS = Path(__file__).with_name('arduino')
LIBRARIES = re.compile(r'#include <(.+\.h)>')


@pytest.mark.skipif(COMPILER is None, reason='there is no C++ compiler')
@pytest.mark.parametrize('core', [2, 3])
@pytest.mark.parametrize('link', ['serial_link.h', 'micro_ros_link.h'])
def test_the_sketch_compiles_with_both_links(tmp_path: Path, core: int, link: str) -> None:
    text = (SKETCH / 'esp32_driver.ino').read_text(encoding='utf-8')
    flag = '#define USE_MICRO_ROS 0'
    assert flag in text
    is_ros = int(link == 'micro_ros_link.h')
    file = tmp_path / 'sketch.cpp'
    file.write_text(text.replace(flag, f'#define USE_MICRO_ROS {is_ros}'), encoding='utf-8')
    # The headers of ESP32 and micro-ROS, which are not on this machine.
    for name in LIBRARIES.findall(text + (SKETCH / 'micro_ros_link.h').read_text('utf-8')):
        header = tmp_path / name
        header.parent.mkdir(parents=True, exist_ok=True)
        header.write_text('#include "micro_ros.h"\n', encoding='utf-8')
    options = ['-std=gnu++11', '-fsyntax-only', '-Wall', '-Wextra', '-Werror']
    options += [f'-DESP_ARDUINO_VERSION_MAJOR={core}', '-include', 'Arduino.h']
    folders = [f'-I{DECLARATIONS}', f'-I{tmp_path}', f'-I{SKETCH}']
    done = subprocess.run(
        [str(COMPILER), *options, *folders, str(file)], capture_output=True, text=True, check=False
    )
    assert done.stderr == ''
    assert done.returncode == 0
