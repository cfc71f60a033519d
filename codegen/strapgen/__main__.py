"""``python -m strapgen`` runs the command line."""

from strapgen.cli import main

if __name__ == "__main__":
    main()
