"""HTML and Markdown pages: one environment, the templates, how numbers are written."""
