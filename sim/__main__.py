"""`python -m sim` is the same as `antdrive`."""

from sim.cli import main

main()
