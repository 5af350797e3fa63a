"""A review for people and machines: text, JSON, CSV, HTML; each file one of them."""
