"""The command ``strapgen study output-filter`` measures the filter of an output on several back ends."""

from __future__ import annotations

from typing import Annotated

from strapgen.cli.option_groups import grouped
from strapgen.cli.options import a_backend, option
from strapgen.cli.output import Output
from strapgen.cli.progress import track
from strapgen.cli.values import Number, Positive


@grouped
def study_output_filter(
    *,
    cutoff_hz: Annotated[
        Positive, option("--cutoff-hz", metavar="HZ", help="Edge, which is damped by 3 dB.", panel="Filter")
    ] = Positive("3.2"),
    sample_hz: Annotated[
        Positive, option("--sample-hz", metavar="HZ", help="Samples in a second.", panel="Filter")
    ] = Positive("50"),
    largest: Annotated[
        Positive,
        option(
            "--largest", metavar="SAMPLE", help="Largest magnitude of a sample, in its unit.", panel="Filter"
        ),
    ] = Positive("128"),
    frequencies: Annotated[
        tuple[Number, ...],
        option(
            "--frequency-hz", metavar="HZ,...", help="Frequencies that are measured, with sines.", panel="Run"
        ),
    ] = tuple(map(Number, ("0.32", "1", "3.2", "8", "10", "20"))),
    backend: Annotated[
        tuple[str, ...],
        option(
            "--backend",
            metavar="NAME,...",
            help="Back ends, with commas between; strapgen list backends shows all.",
            panel="Run",
            read=a_backend,
        ),
    ] = ("c", "c-fixed32", "c-fixed16"),
    output: Output,
) -> None:
    """Measure a Butterworth filter of second order on several back ends, beside its analog and digital response.

    You also see what is left of a constant input and of none, once the filter has settled, without and with error
    feedback in fixed point, and the bound for that in a run of any length.

    Example: strapgen study output-filter --cutoff-hz 8 --sample-hz 100
    """
    output.check()
    from strapgen.navigation.outputs import output_filter_study as experiment
    from strapgen.navigation.outputs.output_filter import OutputFilter
    from strapgen.navigation.outputs.output_filter_report import output_filter_image, output_filter_report

    edge, size = OutputFilter(float(cutoff_hz), float(sample_hz)), float(largest)
    tones = experiment.check_frequencies(edge, [*map(float, frequencies)])
    which = experiment.runs([*backend])
    measured = track(experiment.measure(which, edge, size, tones), "measuring", len(which))
    study = experiment.FilterStudy(edge, size, tones, tuple(measured))
    output.report(output_filter_report(study), lambda path: output_filter_image(study, path))
