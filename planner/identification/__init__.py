"""Contact parameters from measured throws, and how well release models predict those."""
