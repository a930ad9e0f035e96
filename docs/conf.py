"""Settings of the documentation: `sphinx-build -W docs docs/_build` makes it, generated pages included."""

from __future__ import annotations

import sys
from pathlib import Path

import aerotri

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "aerotri"
copyright = "the aerotri developers"
author = "the aerotri developers"
release = aerotri.__version__
version = release

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_design",
    # formulas are drawn without a network
    "sphinx-mathjax-offline",
    "reference_pages",
]
exclude_patterns = ["_build", "_extensions", "**.ipynb_checkpoints"]
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext"}

myst_enable_extensions = ["deflist", "dollarmath", "colon_fence", "attrs_block", "attrs_inline"]
myst_heading_anchors = 4

# notebooks run where the documentation is built; one that fails stops the build
nb_execution_mode = "cache"
nb_execution_cache_path = str(Path(__file__).parent / "_build" / ".notebooks")
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_merge_streams = True

# pages of the Python names are written by reference_pages
autosummary_generate = False
# `aerotri.adjust` in a docstring is a link
default_role = "py:obj"
autodoc_typehints = "none"
numpydoc_show_class_members = False

html_theme = "pydata_sphinx_theme"
html_title = "aerotri"
html_static_path = ["_static"]
html_css_files = ["notebooks.css", "pages.css", "reference.css"]
html_theme_options = {"show_prev_next": True, "navbar_align": "left", "secondary_sidebar_items": ["page-toc"]}
html_copy_source = False
