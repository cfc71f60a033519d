"""What the application brings."""

from __future__ import annotations

from strapgen.applications import Application, Command

_HERE = __name__.rpartition(".")[0]

APPLICATION = Application(
    "test vectors, projects, verification of files, checks of code by others",
    commands={
        "vectors": Command(f"{_HERE}.vectors.vectors_command:vectors", "Generate"),
        "verify": Command(f"{_HERE}.verify.verify_command:verify", "Generate"),
        "check": Command(f"{_HERE}.check_code.check_command:check", "Analyse"),
    },
    extensions={
        "generate.project": f"{_HERE}.project:project",
        "lab.source-files": f"{_HERE}.verify:source_files",
        "navigation.source-files": f"{_HERE}.verify.system_files:runner_of_file",
        "two-speed.project": f"{_HERE}.project:two_speed_project",
    },
    requires=("lab", "navigation", "design"),
)
