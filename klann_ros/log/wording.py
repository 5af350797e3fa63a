"""Numbers in sentences: one message was lost, two messages were."""


def counted(number: int, one: str, many: str = '') -> str:
    """Return how many there are of something, such as `1 message` or `2 messages`."""
    return f'{number} {verb(number, one, many or f"{one}s")}'


def verb(number: int, one: str, many: str) -> str:
    """Return the word that goes with a number, such as `was` or `were`."""
    return one if number == 1 else many


def times(number: int) -> str:
    """Return how often something is: `once`, `twice` or `3 times`."""
    return {1: 'once', 2: 'twice'}.get(number, f'{number} times')


def in_words(number: int) -> str:
    """Return a small number as a word."""
    words = ('no', 'one', 'two', 'three', 'four', 'five', 'six', 'seven', 'eight', 'nine', 'ten')
    return words[number] if 0 <= number < len(words) else str(number)
