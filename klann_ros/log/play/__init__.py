"""When what is played: a timeline, what moves it, and what reads ahead."""
