"""The command `bottomlock`: one module a command family, imported when the command is called."""
