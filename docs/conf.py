"""Sphinx: the documentation site, built by `make docs` from what tools/build_site.py lays out in out/site-source.

MyST reads the same Markdown that a forge shows; MyST-NB runs the scripts of examples/ as they are (jupytext percent
format), which Sphinx-Gallery, whose text is reStructuredText, could not without a second source.
"""

import importlib.metadata
import os
import tempfile
from pathlib import Path

from jupyter_client.manager import KernelManager
from nbclient import NotebookClient

_create = NotebookClient.create_kernel_manager


def _by_files(client: NotebookClient) -> KernelManager:
    """The kernels of the examples talk by files: over TCP each warns of its missing encryption.

    A kernel runs in the folder of its page and Sphinx does not, so that the files' names are absolute; each process
    that reads pages has its own.
    """
    manager = _create(client)
    manager.transport, manager.ip = "ipc", f"{tempfile.gettempdir()}/bottomlock-docs-{os.getpid()}"
    return manager


NotebookClient.create_kernel_manager = _by_files

project = "bottomlock"
author = "The bottomlock authors"
copyright = author  # noqa: A001 - Sphinx's name
release = version = importlib.metadata.version("bottomlock")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "cyclopts.sphinx_ext",
    "tools.site_mathml",
    "tools.site_thumbnails",
    "tools.site_signatures",
]
exclude_patterns: list[str] = []
source_suffix = {".md": "myst-nb", ".py": "myst-nb"}
exclude_patterns += ["conf.py", "**/__pycache__", "**/_downloads/*", "_extra"]

# Markdown as on a forge: anchors of headings, $ for mathematics. Lists of definitions are those of the keys.
myst_enable_extensions = ["dollarmath", "attrs_inline", "colon_fence", "deflist"]
myst_heading_anchors = 4

# Examples run at every build whose script has changed; an error ends the build.
nb_custom_formats = {".py": ["jupytext.reads", {"fmt": "py:percent"}]}
nb_execution_mode = os.environ.get("BOTTOMLOCK_DOCS_EXECUTE", "cache")
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_execution_show_tb = True
nb_output_stderr = "show"
# Figures into their pages, also where the terminal asks for another backend.
os.environ.pop("MPLBACKEND", None)
os.environ["MATPLOTLIBRC"] = str(Path(__file__).resolve().parent / "matplotlibrc")

# Docstrings are Google's sections with code in single backticks.
default_role = "code"
napoleon_numpy_docstring = False
napoleon_use_rtype = False
autodoc_member_order = "bysource"
# tools/site_signatures.py writes the signatures, with types.
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88
add_module_names = False
python_display_short_literal_types = True

html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"bottomlock {release}"
html_static_path = ["_static"]
html_favicon = html_logo = "_static/mark.svg"
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
html_theme_options = {
    "source_repository": "https://github.com/bottomlock/bottomlock/",
    "source_branch": "main",
    "source_directory": "docs/",
}
html_extra_path: list[str] = ["_extra"]
copybutton_exclude = ".linenos, .gp"
smartquotes = False  # quotes of TOML stay as they are written
highlight_language = "none"  # commands are no Python
pygments_style = "friendly"
pygments_dark_style = "native"

# `make docs-links`: pages outside are tried, and do not fail the build where they cannot be reached.
linkcheck_timeout = 10
linkcheck_retries = 1
linkcheck_workers = 8
