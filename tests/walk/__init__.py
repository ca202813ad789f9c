"""The new user's walk: from `git clone` to the report of a log, as the pages tell it."""
