"""What all pages share: one renderer of legs, its styles, and how a page is put into one file."""
