"""The new user's walk: from `git clone` to the removal of what was installed, as the pages tell it."""
