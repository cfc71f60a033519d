"""Files on disk: the cache, drafts of files, what the package ships."""
