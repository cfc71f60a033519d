"""Leaves modules out of the collection of examples that need tools of `make evidence-tools` where these are missing."""

from importlib.util import find_spec

collect_ignore_glob = []
if not (find_spec("z3") and find_spec("pycparser")):
    collect_ignore_glob.append("codegen/strapgen/evidence/overflow/*.py")
