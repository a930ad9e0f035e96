"""A block put together from several files."""
