"""The command ``strapgen two-speed`` writes the C code of an algorithm in two speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from strapgen.cli.fixed_options import FixedOptions
from strapgen.cli.generate_command import SourceOptions
from strapgen.cli.generated_result import GeneratedSources
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.options import CTarget, Sculling, TwoSpeedAlgorithm
from strapgen.cli.output import Format, check_format, show
from strapgen.ir.exceptions import InputError
from strapgen.results.records import INTERNAL
from strapgen.results.result import Result

if TYPE_CHECKING:
    from strapgen.ir.fixed_settings import Settings
    from strapgen.ir.sources import Sources


@grouped
def two_speed(
    algorithm: TwoSpeedAlgorithm,
    *,
    sculling: Sculling = 2,
    target: CTarget = "c",
    fixed: Annotated[
        FixedOptions,
        Shown(
            only=(
                *("word", "max_rate_deg_s", "sample_hz", "lsb", "lsb_rad", "input_bits"),
                *("rounding", "carry", "allowance", "ranges", "formats"),
            )
        ),
    ],
    output: Annotated[SourceOptions, Shown(only=("out", "with_runs", "project", "check", "force"))],
    format: Format = "text",
) -> None:
    """Generate the C code of an algorithm in two speeds.

    You get a function for each loop, and one that runs them all. --sample-hz is the rate of the fast loop, which takes
    one sample of the gyro.

    Example: strapgen two-speed dcm --target c --out firmware

    Example: strapgen two-speed dcm --target c-fixed --sample-hz 400 --lsb 0.0175dps --out firmware
    """
    check_format(format)
    from strapgen.navigation.two_speed import two_speed_sources

    task = request(algorithm, sculling, target, fixed)
    sources = two_speed_sources.sources(*task)
    files = output.files(sources, "two-speed.project", *task)
    if output.check:
        output.show_difference(files, format)
        return
    written = output.write(files)
    loops = two_speed_sources.loops(*task)
    from strapgen.cli import generated_result

    lines = generated_result.head(sources, target, written)
    for loop in loops:
        lines += [
            *generated_result.head(loop, target),
            *(f"  {line}" for line in generated_result.contract(loop)),
        ]
    show(_result(sources, loops, written, "\n".join(lines)), format)


def _result(sources: Sources, loops: Sequence[Sources], written: Sequence[Path], said: str) -> TwoSpeedResult:
    """Return the generated code as a result, with operations and contracts of each loop."""
    from strapgen.catalogue import Choice
    from strapgen.cli.generated_result import GeneratedSources

    places = {path.name: str(path) for path in written}
    functions = [
        GeneratedSources.of(
            Choice(loop.kernel),
            loop,
            sources.target,
            [places[name] for name in loop.step_files if name in places],
        )
        for loop in loops
    ]
    names, files = [loop.kernel for loop in loops], [*places.values()]
    return TwoSpeedResult(sources.kernel, sources.target, names, files, sources.operations, functions, said)


class TwoSpeedRequest(NamedTuple):
    """The arguments of `two_speed_sources.sources` for one call of ``strapgen two-speed``."""

    algorithm: str
    sculling: int
    target: str
    settings: Settings | None


def request(algorithm: str, sculling: int, target: str, fixed: FixedOptions) -> TwoSpeedRequest:
    """Return the request of the options."""
    return TwoSpeedRequest(algorithm, sculling, target, _settings(target, fixed))


def _settings(target: str, fixed: FixedOptions) -> Settings | None:
    """Return the settings of fixed point, which a target in floating point has none of."""
    from strapgen.ir.fixed_settings import Settings
    from strapgen.targets import fixed_targets

    settings = fixed.settings(1)
    if target in fixed_targets():
        return settings or Settings()
    if settings is not None:
        raise InputError(f"the options of fixed point go with --target c-fixed, not with {target}")
    return None


@dataclass(frozen=True)
class TwoSpeedResult(Result):
    """The code of an algorithm in two speeds."""

    kernel: str
    target: str
    #: Kernels of the loops
    loops: Sequence[str]
    files: Sequence[str]
    #: Operations of a call by kind
    operations: Mapping[str, int]
    #: The loops, as generate has them
    functions: Sequence[GeneratedSources]
    said: str = field(metadata=INTERNAL)

    def text(self) -> str:
        """Return operations, files and contracts."""
        return self.said
