"""The command ``strapgen init``: writes a strapgen.toml from five answers or a brief."""

from __future__ import annotations

import shlex
import sys
import tomllib
from decimal import Decimal
from pathlib import Path
from typing import Annotated, Any

import typer

from strapgen.cli import terminal
from strapgen.cli.option_groups import Excludes, grouped, rules
from strapgen.cli.options import option
from strapgen.cli.values import Positive, names
from strapgen.ir.exceptions import InputError

#: The workflow that holds the variants.
WORKFLOW = ".github/workflows/strapgen.yml"
_HEAD = """\
# strapgen build generates the variants, strapgen build --check holds them; other commands take --variant NAME.
# A variant states options of strapgen generate by their names, with _ in place of -. For an editor that reads
# JSON Schema: strapgen schema variants.toml --out strapgen.schema.json
"""


@grouped
@rules(
    Excludes("--brief", "--sample-hz --max-rate-deg-s --target --word", reason="--brief states the sensor")
)
def init(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the variant.")] = "attitude",
    *,
    sample_hz: Annotated[
        Positive | None,
        option(
            "--sample-hz", metavar="HZ", help="Samples of the gyro in a second.  [default: asked, or 200]"
        ),
    ] = None,
    max_rate_deg_s: Annotated[
        Positive | None,
        option(
            "--max-rate-deg-s",
            metavar="DEG_S",
            help="Largest body rate about any axis in deg/s.  [default: asked, or 400]",
        ),
    ] = None,
    target: Annotated[
        str | None,
        option(
            "--target",
            metavar="NAME",
            help="Kind of code; strapgen list targets shows all.  [default: asked, or c-fixed]",
            read=names("strapgen.targets:TARGETS"),
        ),
    ] = None,
    word: Annotated[
        int | None,
        option("--word", metavar="BITS", help="Word of fixed point in bits.  [default: asked, or 32]"),
    ] = None,
    out: Annotated[
        Path | None,
        option("--out", metavar="FOLDER", help="Folder for the files.  [default: asked, or firmware]"),
    ] = None,
    brief: Annotated[
        Path | None,
        option("--brief", metavar="FILE", help="TOML file with a brief, whose cheapest algorithm is taken."),
    ] = None,
) -> None:
    """Write a strapgen.toml from five answers or a brief.

    On a terminal you are asked what no option states; elsewhere the defaults are taken, and printed. A workflow for
    GitHub that runs strapgen build --check is written beside it. The algorithm is euler with the method rk4 and two
    increments a step, unless a brief selects another.

    Example: strapgen init --sample-hz 200 --max-rate-deg-s 400

    Example: strapgen init --brief examples/briefs/ahrs.toml
    """
    from strapgen.storage.files import write_files
    from strapgen.variants import variant_file

    place = Path(variant_file.NAME)
    for path in (place, Path(WORKFLOW)):
        if path.exists():
            raise InputError(f"{path} is there already; strapgen init writes over no file")
    files: dict[str, str] = {}
    if brief is None:
        stated = {"sample_hz": sample_hz, "max_rate_deg_s": max_rate_deg_s, "target": target, "word": word}
        keys = _ask(stated, out)
    else:
        keys, files = _of_brief(brief)
        keys["out"] = _answer("Folder for the code", out, "firmware")
    text = _text(name, keys)
    variant_file.parse(place, tomllib.loads(text, parse_float=Decimal))
    for path in write_files(Path(), {str(place): text, WORKFLOW: _workflow(), **files}):
        terminal.remark(f"wrote {path}")
    typer.echo("strapgen build generates the code, strapgen build --check holds it")


def _answer(question: str, stated: Any, default: Any) -> str:
    """Return what is stated, or the answer on a terminal, or the default, which is printed."""
    if stated is not None:
        return str(stated)
    if sys.stdin is not None and sys.stdin.isatty():
        return str(typer.prompt(question, default=str(default)))
    terminal.remark(f"{question}: {default}")
    return str(default)


def _ask(stated: dict[str, Any], out: Path | None) -> dict[str, Any]:
    from strapgen.targets import TARGETS

    keys: dict[str, Any] = {"algorithm": "euler", "method": "rk4", "increments": "2"}
    keys["sample_hz"] = _answer("Samples of the gyro in a second", stated["sample_hz"], 200)
    keys["max_rate_deg_s"] = _answer("Largest body rate about any axis, deg/s", stated["max_rate_deg_s"], 400)
    target = keys["target"] = _answer(
        "Kind of code (strapgen list targets shows all)", stated["target"], "c-fixed"
    )
    entry = TARGETS.get(target)
    if entry is not None and not entry.fixed:
        if stated["word"] is not None:
            raise InputError(f"--word goes with fixed point, not with {target}")
    else:
        keys["word"] = _answer("Word of fixed point in bits", stated["word"], 32)
    keys["out"] = _answer("Folder for the code", out, "firmware")
    if entry is not None and entry.compiled:
        keys["project"] = True
    return keys


def _of_brief(file: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the keys of the cheapest algorithm that meets a brief, and the files that it needs."""
    from strapgen.cli.progress import track
    from strapgen.design.brief import read_brief
    from strapgen.design.selection.candidates import contenders
    from strapgen.design.selection.judgement import in_order, judgements
    from strapgen.design.selection.selection_report import COEFFICIENTS, REPORT, firmware_files
    from strapgen.design.selection.simulated import algorithm_named, confirm
    from strapgen.run.standard_tree import command_of

    brief = read_brief(file)
    several = contenders(brief, None)
    rows = track(judgements(file, several, None, None, None), "judging", len(several))
    ordered = confirm(brief, file, in_order(one for row in rows for one in row))
    if not ordered or not ordered[0].meets:
        raise InputError(f"{file}: no algorithm meets the brief; strapgen design {file} shows why")
    best = ordered[0]
    made = firmware_files(
        brief, best, algorithm_named(best, brief, file), "", f"strapgen design {shlex.quote(str(file))}"
    )
    made.pop(REPORT)
    command = next((found for text in made.values() if (found := command_of(text))), "")
    words = shlex.split(command)
    if words[:2] != ["strapgen", "generate"]:
        raise InputError(
            f"{file}: {best.name} meets the brief, which is no step of its own; strapgen design --generate writes it"
        )
    terminal.remark(f"{best.name} meets the brief")
    keys: dict[str, Any] = {"algorithm": words[2]}
    keys |= {key[2:].replace("-", "_"): value for key, value in zip(words[3::2], words[4::2], strict=False)}
    return keys | {"project": True}, {name: text for name, text in made.items() if name == COEFFICIENTS}


def _text(name: str, keys: dict[str, Any]) -> str:
    """Return the text of a file with one variant."""
    lines = [_HEAD, f"[variant.{name}]"]
    for key, value in keys.items():
        plain = (
            str(value).lower() if isinstance(value, bool) else value if _is_number(value) else f'"{value}"'
        )
        lines.append(f"{key} = {plain}")
    lines += ["", f"[variant.{name}.checks]", "verify = true"]
    lines += ['# cost = [{ cpu = "cortex-m3", executed = 250 }]', '# evidence = ["gappa"]']
    return "\n".join(lines) + "\n"


def _is_number(text: str) -> bool:
    return text.replace(".", "", 1).isdigit()


def _workflow() -> str:
    from strapgen.ir.version import VERSION
    from strapgen.storage import resources

    template = resources.folder("templates") / "ci" / "strapgen.yml"
    return template.read_text(encoding="utf-8").replace("VERSION", VERSION)
