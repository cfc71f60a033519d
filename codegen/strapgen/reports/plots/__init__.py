"""Plots write results as image files, one module for each kind of result; they need the extra `plot`."""

from strapgen.reports.plots.agreement import agreement_image as agreement_image
from strapgen.reports.plots.comparison import comparison_image as comparison_image
from strapgen.reports.plots.convergence import convergence_image as convergence_image
from strapgen.reports.plots.figures import require_kind as require_kind
from strapgen.reports.plots.frontier import frontier_image as frontier_image
from strapgen.reports.plots.rate_table import rate_table_image as rate_table_image
from strapgen.reports.plots.runs import course_image as course_image
from strapgen.reports.plots.runs import history_image as history_image
from strapgen.reports.plots.runs import plot_history as plot_history
from strapgen.reports.plots.runs import plot_run as plot_run
from strapgen.reports.plots.runs import run_image as run_image
from strapgen.reports.plots.stability import stability_image as stability_image
from strapgen.reports.plots.thesis_tables import predicted_tables_image as predicted_tables_image
from strapgen.reports.plots.thesis_tables import thesis_tables_image as thesis_tables_image
from strapgen.reports.plots.vibration import vibration_image as vibration_image
from strapgen.reports.plots.window import window_image as window_image
from strapgen.reports.plots.word_length import word_length_image as word_length_image
