"""Time of a preintegrated sample in generated C++, with covariance and bias Jacobian, and in GTSAM where it is there.

    python benchmarks/preintegration.py [--compiler g++] [--flags=-O2]

A sample of the header is its part of an interval of 100 samples between instants that are no stamps: the samples are
taken to even intervals, and those before and after the interval that a window needs are counted in. GTSAM is called
from Python, a call a sample: its time includes the call.
"""

from __future__ import annotations

import argparse
import importlib.util
import shlex
import subprocess
import tempfile
import time
from pathlib import Path

from strapgen.navigation.preintegration import preintegration_sources

MAIN = """
#include "imu.hpp"
#include <cstdio>
#include <ctime>

int main()
{
    static strapgen::imu<400> unit(200.0, 1e-4, 2e-3);
    for (int k = 0; k < 200; ++k) {
        const double rate[3] = { 0.01 * (k % 7), -0.02 * (k % 5), 0.5 };
        const double force[3] = { 0.3 * (k % 4), 0.1, 9.8 };
        unit.push(5000000LL * k + 1000 * (k % 3), rate, force);
    }
    const double none[3] = { 0.0, 0.0, 0.0 };
    strapgen::imu_factor factor = strapgen::imu_factor();
    double best = 1e9, sum = 0.0;
    for (int round = 0; round < 7; ++round) {
        const clock_t begin = clock();
        for (int k = 0; k < 400; ++k) {
            if (unit.between(251234567 + k, 751234567 + k, none, none, factor) != strapgen::imu_status::ok)
                return 1;
            sum += factor.position[0];
        }
        const double took = double(clock() - begin) / CLOCKS_PER_SEC / 40000.0;
        best = took < best ? took : best;
    }
    std::printf("%.3f %g\\n", best * 1e6, sum);
}
"""


def generated(window: str, compiler: str, flags: str) -> float:
    """Return the processor time of a sample in us."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        sources = preintegration_sources.sources(window, "rates", name="imu")
        (folder / "imu.hpp").write_text(sources.files["imu.hpp"])
        (folder / "main.cpp").write_text(MAIN)
        command = [compiler, "-std=c++14", *shlex.split(flags), "-o", "main", "main.cpp"]
        subprocess.run(command, cwd=folder, check=True)
        done = subprocess.run([folder / "main"], capture_output=True, text=True, check=True)
    return float(done.stdout.split()[0])


def gtsam_time() -> float:
    """Return the processor time of a sample of GTSAM from Python in us, the call included."""
    import gtsam
    import numpy as np

    parameters = gtsam.PreintegrationParams.MakeSharedU(9.81)
    parameters.setGyroscopeCovariance(1e-8 * np.eye(3))
    parameters.setAccelerometerCovariance(4e-6 * np.eye(3))
    parameters.setIntegrationCovariance(1e-12 * np.eye(3))
    rate, force = np.array([0.01, -0.02, 0.5]), np.array([0.3, 0.1, 9.8])
    best = float("inf")
    for _ in range(7):
        sums = gtsam.PreintegratedImuMeasurements(parameters, gtsam.imuBias.ConstantBias())
        begin = time.process_time()
        for _ in range(2000):
            sums.integrateMeasurement(force, rate, 0.005)
        best = min(best, (time.process_time() - begin) / 2000)
    return best * 1e6


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--compiler", default="g++")
    parser.add_argument("--flags", default="-O2")
    options = parser.parse_args()
    print("| | us a sample |\n|---|--:|")
    for window in ("kept-sample", "pair-1-5", "pair-1-8"):
        print(f"| {window} | {generated(window, options.compiler, options.flags):.2f} |", flush=True)
    if importlib.util.find_spec("gtsam"):
        print(f"| GTSAM, from Python with its call | {gtsam_time():.2f} |")
    else:
        print("GTSAM is not installed")


if __name__ == "__main__":
    main()
