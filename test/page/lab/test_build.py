"""The page that is installed is the one that its parts make."""

from klann_ros.page.lab.build import FILE, lab_page


def test_the_file_is_up_to_date() -> None:
    message = 'python -m klann_ros.page.lab.build writes it anew'
    assert FILE.read_text(encoding='utf-8') == lab_page(), message


def test_it_is_small_enough_to_be_passed_on() -> None:
    assert FILE.stat().st_size < 300_000
