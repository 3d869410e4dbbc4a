"""How Sphinx builds the site: `make docs` puts it into docs/_build/html, without the network."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]
os.environ.setdefault("MPLBACKEND", "agg")

project = "antdrive"
author = "the authors of antdrive"
copyright = "the authors of antdrive"
release = version = version_of("antdrive")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "antdrive_api",
    "antdrive_site",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = [
    "_build",
    "_ext",
    "_templates",
    "gallery",
    "_gallery/sg_execution_times.rst",
    "sg_execution_times.rst",
]
# Each is written by sphinx-gallery; none says anything that its page does not.
suppress_warnings = ["config.cache"]

# Markdown. Anchors are those that GitHub gives to headings, so that links work in both places.
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_inline", "attrs_block"]
myst_heading_anchors = 4
html_math_renderer = "mathml"  # what browsers draw themselves; MathJax would be loaded from the network

# The API. Docstrings write `code` in single backticks.
smartquotes = False  # they make one dash of the two before an option
default_role = "code"
antdrive_index_only = ["antdrive"]  # other pages describe what these offer
add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
# Types are shown by the names that signatures give them.
_ALIASES = ["Floats", "Flags", "Ints", "Pose", "Point", "Bounds", "Cell", "Cells", "Mover"]
autodoc_type_aliases = {name: name for name in _ALIASES}
autodoc_class_signature = "mixed"
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
toc_object_entries_show_parents = "hide"
# Types of other projects. Their pages are elsewhere, and the build does not ask the network for where.
nitpick_ignore_regex = [
    ("py:.*", r"(numpy|np|numpy\.typing|npt)\.[\w.]+"),
    ("py:.*", r"(matplotlib|pyarrow|pandas|pydantic|hypothesis|typer|distributed|dask)(\.[\w.]+)?"),
    (
        "py:.*",
        r"(antdrive\.(views\.pages\.campaign_summary|runs\.campaigns\.running)\.)?(Path|Figure|SearchStrategy|CampaignSummary|Finished|Ants|Ranking)",
    ),
    ("py:.*", r"(typing|collections|pathlib|enum|os|types|abc|contextlib|dataclasses)\.[\w.]+"),
    # Arrays as compiled code takes them; no part of what is offered.
    ("py:class", r"antdrive\.[\w.]+\._kernels_\w+\.\w+|MoveGraph|AntGraph"),
    # How `sweep` words the origin of random tasks.
    ("py:class", r"antdrive\.runs\.campaigns\.job\.TaskOrigin"),
    ("py:class", "ErrorAt"),  # a type of functions
    ("py:class", r"antdrive\.foreign\.playback\.ForeignRollout"),  # one for which `certify` has a form of its own
    (
        "py:class",
        r"Flags|Colour|antdrive\.base\.(registry\.Component|components\.Declared)",
    ),  # an array, a colour, type variables
    ("py:.*", r"(gymnasium\.[\w.]+|ResetNeeded)"),
    # How a record's field is read from JSON.
    ("py:.*", r"antdrive\.[\w.]+\.(Annotated|_to_\w+)"),
    # Contents of files, whose keys the pages on formats describe.
    (
        "py:class",
        r"antdrive\.(runs\.campaigns\.campaign|runs\.suites\.suite)\.(\w+Entry|CampaignFile|RandomTasks)",
    ),
]

# The gallery: each example is run by the build.
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "parallel": True,  # as many as --jobs says
    "gallery_dirs": "_gallery",
    "filename_pattern": r"\.py$",
    "image_scrapers": ("antdrive_site.scrape",),
    "reset_modules": (),
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "show_memory": False,
    "capture_repr": ("_repr_html_",),
    "remove_config_comments": True,
    "within_subsection_order": "antdrive_site.gallery_order",
    "plot_gallery": "True",
    "copyfile_regex": r"a^",
    "min_reported_time": 10_000,
    "write_computation_times": False,
}

html_theme = "pydata_sphinx_theme"
html_title = "antdrive"
html_context = {"default_mode": "auto"}  # without it the theme writes an error to the console on the first visit
html_static_path = ["_static"]
templates_path = ["_templates"]
html_css_files = ["antdrive.css"]
html_search_scorer = str(HERE / "_static" / "scorer.js")
copybutton_prompt_text = "$ "  # a console block copies its commands alone
copybutton_only_copy_prompt_lines = True
html_sidebars = {"notebook/*": []}  # no page of the main navigation
html_copy_source = False
html_show_sourcelink = False
html_show_search_summary = False  # summaries are fetched, which browsers refuse for files on disk
html_theme_options = {
    "show_prev_next": True,
    "navigation_with_keys": False,
    "header_links_before_dropdown": 7,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
    "show_toc_level": 2,
    "collapse_navigation": True,  # else every page lists all classes of the API
}
