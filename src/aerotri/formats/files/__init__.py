"""Files and folders: written whole or not at all, known as our own, archives of arrays."""
