"""HTML and Markdown pages: templates, their environment, number formatting."""
