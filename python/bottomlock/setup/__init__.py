"""Setting `bottomlock live` up in a browser: a form, the process, its logs; what the BlueOS extension runs."""
