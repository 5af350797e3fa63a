"""What is wrong with a run: each file a kind of check, `all_checks` all of them."""
