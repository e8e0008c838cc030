"""`python -m bottomlock` is the command `bottomlock`."""

from bottomlock.cli.app import main

if __name__ == "__main__":
    main()
