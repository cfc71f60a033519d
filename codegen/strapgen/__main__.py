"""``python -m strapgen``."""

from strapgen.cli import main

main()
