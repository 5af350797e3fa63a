"""Reading logs however they are stored: a storage for each kind of file."""
