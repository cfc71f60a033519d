"""What the folder brings."""

from __future__ import annotations

from strapgen.registration import Command, Registration

REGISTRATION = Registration(
    "two speeds, described systems, instruments, loops, redundancy, calibration",
    commands={
        "two-speed": Command(
            f"{__package__}.two_speed.two_speed_command:two_speed",
            "Generate",
            summary="Generate the C code of an algorithm in two speeds",
        ),
        "system": Command(
            f"{__package__}.systems.system_command:system",
            "Generate",
            summary="Check a described system and generate its code",
        ),
        "redundancy": Command(
            f"{__package__}.redundancy.redundancy_command:redundancy",
            "Generate",
            summary="Derive what redundant sensors tell of their failures",
        ),
        "strapdown": Command(
            f"{__package__}.courses.strapdown_command:strapdown",
            "Run",
            summary="Run an algorithm in two speeds along an inertial recording",
        ),
        "study system": Command(f"{__package__}.systems.study_system_command:study_system"),
        "study attitude-form": Command(
            f"{__package__}.attitude_form.attitude_form_command:study_attitude_form"
        ),
        "study output-filter": Command(f"{__package__}.outputs.output_filter_command:study_output_filter"),
        "study redundancy": Command(f"{__package__}.redundancy.redundancy_study_command:study_redundancy"),
        "study calibration": Command(f"{__package__}.calibration.calibration_command:study_calibration"),
        "study pulse-torque": Command(f"{__package__}.torquing.pulse_torque_command:study_pulse_torque"),
        "study loops": Command(f"{__package__}.loops.loops_command:study_loops"),
        "rate-table": Command(
            f"{__package__}.rate_table.rate_table_command:rate_table",
            "Reproduce",
            summary="Run the rate-table test of 1984 on every algorithm and back end",
        ),
        "study velocity-position": Command(
            f"{__package__}.velocity_position.velocity_position_command:study_velocity_position"
        ),
        "stress": Command(f"{__package__}.rate_table.rate_table_command:rate_table", hidden=True),
    },
    kernels=(
        f"{__package__}.systems.sampling_names:SAMPLING",
        f"{__package__}.two_speed.two_speed_names:TWO_SPEED_LOOPS",
        f"{__package__}.instruments.compensation_names:COMPENSATION",
        f"{__package__}.instruments.compensation_names:LAYOUTS",
        f"{__package__}.frame.navigation_names:NAVIGATION",
        f"{__package__}.redundancy.redundancy_names:REDUNDANCY",
        f"{__package__}.outputs.output_names:OUTPUTS",
        f"{__package__}.outputs.output_names:TWO_ROWS",
        f"{__package__}.loops.loop_names:LOOPS",
    ),
    files={
        "system": f"{__package__}.systems.system_file:SYSTEM",
        "loops": f"{__package__}.loops.loop_schedule:SCHEDULE",
        "layout": f"{__package__}.instruments.layout:LAYOUT",
        "redundancy": f"{__package__}.redundancy.geometry_file:GEOMETRY",
        "calibration": f"{__package__}.calibration.calibration_file:POSITIONS",
    },
    lists={"systems": f"{__package__}.systems.built_in:names"},
    extensions={
        "lab.described": f"{__package__}.systems.described:SYSTEMS",
        "design.two-speed": f"{__package__}.two_speed.two_speed_selection:TwoSpeedLoops",
    },
    requires=("lab", "analysis", "design"),
)
