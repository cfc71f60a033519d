"""``python -m strapgen``."""

from strapgen.cli import main

if __name__ == "__main__":
    main()
