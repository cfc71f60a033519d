"""Generated sources: by choice, from the cache; the standard catalogue as a tree of files."""
