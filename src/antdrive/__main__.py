"""`python -m antdrive` is the same as the command `antdrive`."""

from antdrive.cli.app import main

if __name__ == "__main__":
    main()
