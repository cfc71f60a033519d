"""Registration of this folder."""

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
            summary="Derive parity equations and failure isolation for sensors",
        ),
        "preintegrate": Command(
            f"{__package__}.preintegration.preintegrate_command:preintegrate",
            "Generate",
            summary="Generate a C++ header that preintegrates stamped samples",
        ),
        "kalman": Command(
            f"{__package__}.kalman.kalman_command:kalman",
            "Generate",
            summary="Generate a Kalman filter from its description",
        ),
        "strapdown": Command(
            f"{__package__}.strapdown_command:strapdown",
            "Run",
            summary="Run an algorithm in two speeds along an inertial recording",
        ),
        "study system": Command(f"{__package__}.study_commands:study_system"),
        "study flight-errors": Command(f"{__package__}.study_commands:study_flight_errors"),
        "study attitude-form": Command(f"{__package__}.study_commands:study_attitude_form"),
        "study output-filter": Command(f"{__package__}.study_commands:study_output_filter"),
        "study redundancy": Command(f"{__package__}.study_commands:study_redundancy"),
        "study calibration": Command(f"{__package__}.study_commands:study_calibration"),
        "study pulse-torque": Command(f"{__package__}.study_commands:study_pulse_torque"),
        "study loops": Command(f"{__package__}.study_commands:study_loops"),
        "rate-table": Command(
            f"{__package__}.study_commands:rate_table",
            "Reproduce",
            summary="Run the rate-table test of 1984 on every algorithm and back end",
        ),
        "study velocity-position": Command(f"{__package__}.study_commands:study_velocity_position"),
        "stress": Command(f"{__package__}.study_commands:rate_table", hidden=True),
    },
    kernels=(f"{__package__}.navigation_kernels:KERNELS",),
    motions=(f"{__package__}.vehicle.vehicle_motion_names:TABLE",),
    files={
        "motion": f"{__package__}.vehicle.course_file:COURSE",
        "system": f"{__package__}.systems.system_file:SYSTEM",
        "loops": f"{__package__}.loops.loop_schedule:SCHEDULE",
        "layout": f"{__package__}.instruments.layout:LAYOUT",
        "filter": f"{__package__}.filters.filter_file:FILTER",
        "redundancy": f"{__package__}.redundancy.redundancy_kernels:GEOMETRY",
        "calibration": f"{__package__}.calibration:POSITIONS",
        "kalman": f"{__package__}.kalman.kalman_file:KALMAN",
    },
    results={
        "preintegration": f"{__package__}.preintegration.preintegration_sources:PreintegrationResult",
        "kalman": f"{__package__}.kalman.kalman_report:KalmanResult",
        "two-speed": f"{__package__}.two_speed.two_speed_command:TwoSpeedResult",
        "system": f"{__package__}.systems.system_report:SystemResult",
        "flight-errors": f"{__package__}.systems.flight_errors:FlightErrorsResult",
        "flight": f"{__package__}.systems.system_flight:FlightResult",
        "system-outputs": f"{__package__}.systems.system_runs:SystemCourseResult",
        "system-certificate": f"{__package__}.systems.system_certificate:SystemCertificateResult",
        "system-comparison": f"{__package__}.systems.system_comparison:SystemComparisonResult",
        "system-study": f"{__package__}.systems.system_study:SystemStudyResult",
        "course": f"{__package__}.courses:CourseResult",
        "redundant-sensors": f"{__package__}.redundancy.geometry_report:GeometryResult",
        "redundancy": f"{__package__}.redundancy.redundancy_study:RedundancyResult",
        "calibration": f"{__package__}.calibration:CalibrationResult",
        "attitude-form": f"{__package__}.attitude_form:FormResult",
        "output-filter": f"{__package__}.filters.filter_study:FilterResult",
        "pulse-torque": f"{__package__}.torquing:TorquingResult",
        "loops": f"{__package__}.loops.loops_study:LoopsResult",
        "rate-table": f"{__package__}.rate_table:RateTableResult",
        "velocity-position": f"{__package__}.translations:TranslationResult",
    },
    lists={"systems": f"{__package__}.systems.built_in:names"},
    extensions={
        "lab.motion-files": f"{__package__}.vehicle.vehicle_motion_names:FILES",
        "lab.described": f"{__package__}.systems.system_simulation:SYSTEMS",
        "design.two-speed": f"{__package__}.two_speed.two_speed_selection:TwoSpeedLoops",
    },
    requires=("lab", "analysis", "design"),
)
