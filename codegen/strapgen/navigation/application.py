"""What the application brings."""

from __future__ import annotations

from strapgen.applications import Application, Command

_HERE = __name__.rpartition(".")[0]

APPLICATION = Application(
    "two speeds, described systems, instruments, loops, redundancy, calibration",
    commands={
        "two-speed": Command(f"{_HERE}.two_speed.two_speed_command:two_speed", "Generate"),
        "system": Command(f"{_HERE}.systems.system_command:system", "Generate"),
        "redundancy": Command(f"{_HERE}.redundancy.redundancy_command:redundancy", "Generate"),
        "strapdown": Command(f"{_HERE}.courses.strapdown_command:strapdown", "Run"),
        "study system": Command(f"{_HERE}.systems.study_system_command:study_system"),
        "study attitude-form": Command(f"{_HERE}.attitude_form.attitude_form_command:study_attitude_form"),
        "study output-filter": Command(f"{_HERE}.outputs.output_filter_command:study_output_filter"),
        "study redundancy": Command(f"{_HERE}.redundancy.redundancy_study_command:study_redundancy"),
        "study calibration": Command(f"{_HERE}.calibration.calibration_command:study_calibration"),
        "study pulse-torque": Command(f"{_HERE}.torquing.pulse_torque_command:study_pulse_torque"),
        "study loops": Command(f"{_HERE}.loops.loops_command:study_loops"),
        "rate-table": Command(f"{_HERE}.rate_table.rate_table_command:rate_table", "Reproduce"),
        "study velocity-position": Command(
            f"{_HERE}.velocity_position.velocity_position_command:study_velocity_position"
        ),
        "stress": Command(f"{_HERE}.rate_table.rate_table_command:rate_table", hidden=True),
    },
    kernels=(
        f"{_HERE}.systems.sampling_names:SAMPLING",
        f"{_HERE}.two_speed.two_speed_names:TWO_SPEED_LOOPS",
        f"{_HERE}.instruments.compensation_names:COMPENSATION",
        f"{_HERE}.instruments.compensation_names:LAYOUTS",
        f"{_HERE}.frame.navigation_names:NAVIGATION",
        f"{_HERE}.redundancy.redundancy_names:REDUNDANCY",
        f"{_HERE}.outputs.output_names:OUTPUTS",
        f"{_HERE}.outputs.output_names:TWO_ROWS",
        f"{_HERE}.loops.loop_names:LOOPS",
    ),
    lists={"systems": f"{_HERE}.systems.built_in:names"},
    extensions={
        "lab.described": f"{_HERE}.systems.described:SYSTEMS",
        "design.two-speed": f"{_HERE}.two_speed.two_speed_selection:TwoSpeedLoops",
    },
    requires=("lab", "analysis", "design"),
)
