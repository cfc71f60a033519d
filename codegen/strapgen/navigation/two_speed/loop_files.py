"""Runs files of an algorithm in two speeds in place of the built-in system with the same loops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from strapgen.ir.exceptions import InputError
from strapgen.navigation.systems.system import DescribedSystem
from strapgen.navigation.systems.system_backends import SystemMemory, SystemRun
from strapgen.navigation.two_speed.two_speed_runner import TwoSpeed


class LoopFiles:
    """Three loops at the rates of a described system."""

    def __init__(self, loops: TwoSpeed, system: DescribedSystem) -> None:
        self.loops = loops
        self.system = system

    def run(self, inputs: Mapping[str, Any]) -> SystemRun:
        """Run whole navigation cycles, and return the outputs of the system."""
        fast, slow, navigation = self.system.stages
        wired = {w.input: w.source for stage in self.system.stages for w in stage.wires if w.external}
        angles, velocities, turns = (
            np.asarray(inputs[wired[name]], float) for name in ("increment", "velocity_increment", "turn")
        )
        if len(angles) % navigation.every:
            raise InputError(
                f"the run has {len(angles)} cycles; two speeds take whole navigation cycles, of {navigation.every}"
            )
        run = self.loops.run(
            angles,
            velocities,
            fast_cycles=slow.every // fast.every,
            slow_cycles=navigation.every // slow.every,
            turns=np.concatenate([np.zeros((1, 3)), turns[slow.every - 1 :: slow.every]]),
        )
        state, change = slow.results[0][1], dict(navigation.results)["velocity_change"]
        values = {state: run.attitudes, change: run.velocity_changes}
        return SystemRun({name: values[name] for name in self.system.outputs}, SystemMemory({}, {}))
