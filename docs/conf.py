"""Sphinx's settings for the site that `make docs` builds of these pages."""

import pathlib
import sys

_DOCS = pathlib.Path(__file__).parent
sys.path.insert(0, str(_DOCS.parent))

import fetch_composer  # noqa: E402
from docs.site import linked_files, task_pages  # noqa: E402

project = html_title = 'fetch_composer'
version = release = fetch_composer.__version__
copyright = 'the authors of fetch_composer'

extensions = ['myst_nb', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon', 'sphinx.ext.viewcode']
html_theme = 'furo'
html_static_path = ['site/static']
html_css_files = ['site.css']
html_show_sphinx = False
html_copy_source = False
pygments_style, pygments_dark_style = 'friendly', 'monokai'

myst_heading_anchors = 6  # Headings have the anchors that GitHub gives them.
smartquotes = False  # `--task` is no dash.

nb_execution_mode = 'force'
nb_execution_raise_on_error = True
nb_execution_timeout = 300  # s for a cell
nb_merge_streams = True

default_role = 'code'  # Names in docstrings are in single backticks.
autodoc_mock_imports = ['stable_baselines3', 'torch']  # They take gigabytes.
autodoc_member_order = 'bysource'
autodoc_typehints = 'description'
autodoc_typehints_description_target = 'documented'
autodoc_preserve_defaults = True
autodoc_class_signature = 'separated'
autodoc_default_options = {'members': True}
napoleon_numpy_docstring = False
napoleon_use_ivar = True
python_maximum_signature_line_length = 70


def setup(app) -> None:
    """Writes the pages that are generated, and lets links lead to them."""
    task_pages.write(_DOCS / 'generated' / 'tasks')
    linked_files.write()
    app.connect('source-read', _point_links_into_the_site)


def _point_links_into_the_site(app, name: str, content: list[str]) -> None:
    page = pathlib.Path(app.env.doc2path(name))
    if linked_files.GENERATED not in page.parents:
        content[0] = linked_files.rewritten(content[0], page)
