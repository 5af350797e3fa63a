"""Only plain files are read, and no more of them than is allowed."""

import argparse
import os
import socket

from klann_ros import cli
from klann_ros.robot import robot_of, RobotFileError
from klann_ros.sanitize.files import (
    is_hollow,
    is_regular_file,
    next_data,
    NotRegularFileError,
    open_regular,
    read_regular,
)
import pytest


def test_only_regular_files_are_opened(tmp_path) -> None:
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'link').symlink_to(tmp_path / 'pipe')
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(tmp_path / 's'))
        for path, kind in (
            (tmp_path / 'pipe', 'a named pipe'),
            (tmp_path / 'link', 'a named pipe'),
            ('/dev/zero', 'a device'),
            (tmp_path, 'a folder'),
            (tmp_path / 's', 'a socket'),
        ):
            with pytest.raises(NotRegularFileError) as caught:
                open_regular(path)
            assert caught.value.strerror == f'it is {kind}, not a regular file'
            assert not is_regular_file(path)


def test_a_file_and_a_link_to_it_are_read(tmp_path) -> None:
    path = tmp_path / 'file'
    path.write_text('é')
    (tmp_path / 'link').symlink_to(path)
    assert read_regular(tmp_path / 'link', 2) == 'é'
    with open_regular(path) as file:
        assert file.read() == 'é'.encode()
        assert os.get_blocking(file.fileno()) is False  # which means nothing for a file


def test_long_and_non_text_files_are_refused_as_such(tmp_path) -> None:
    path = tmp_path / 'file'
    path.write_bytes(b'a\xff')
    with pytest.raises(ValueError, match='no UTF-8 text: invalid start byte at byte 1'):
        read_regular(path, 10)
    os.truncate(path, 10**12)
    with pytest.raises(ValueError, match='longer than 1000 bytes'):
        read_regular(path, 1000)


def test_a_missing_file_is_named(tmp_path) -> None:
    with pytest.raises(FileNotFoundError):
        open_regular(tmp_path / 'none')
    assert not is_regular_file(tmp_path / 'none')
    assert not is_regular_file('a\0b')


def test_the_next_data_behind_a_hole_is_found_without_a_seek(tmp_path) -> None:
    path = tmp_path / 'sparse'
    block, far = 2**20, 2**40
    with path.open('wb') as file:
        file.write(b'a' * block)
        file.seek(far)
        file.write(b'b' * block)
        file.truncate(2 * far)
    with open_regular(path) as file:
        assert file.read(3) == b'aaa'
        assert next_data(file, 5) == 5
        assert 5 < next_data(file, 2 * block) <= far
        assert next_data(file, far + 7) == far + 7
        assert next_data(file, far + 2 * block) == 2 * far
        assert next_data(file, 3 * far) == 2 * far
        assert file.read(block) == b'a' * (block - 3) + b'\0' * 3


def test_a_stretch_is_hollow_if_little_of_it_was_written(tmp_path) -> None:
    path, block = tmp_path / 'sparse', 2**20
    with path.open('wb') as file:
        file.truncate(100 * block)
        file.seek(40 * block)
        file.write(b'a' * 10 * block)
    with open_regular(path) as file:
        assert is_hollow(file, 0, 100 * block)
        assert not is_hollow(file, 0, 50 * block)
        assert not is_hollow(file, 40 * block, 50 * block)
        assert is_hollow(file, 60 * block, 61 * block)
        assert not is_hollow(file, 45 * block, 45 * block)


def test_a_path_longer_than_any_is_refused_in_one_line() -> None:
    name = 'a' * 5000
    with pytest.raises(argparse.ArgumentTypeError, match='File name too long'):
        cli.path(name)
    with pytest.raises(RobotFileError, match='File name too long'):
        robot_of(name)
