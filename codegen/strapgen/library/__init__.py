"""The library returns programs and sources from the cache, and the standard catalogue as a tree of files."""
