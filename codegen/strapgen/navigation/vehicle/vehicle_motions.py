"""The motions over the earth that have a name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from strapgen.analysis.vibration.spectrum import Spectrum
from strapgen.ir.exceptions import InputError
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.motions.users_motions import any_motion
from strapgen.navigation.vehicle.controls import Controls, Pulse, Waves
from strapgen.navigation.vehicle.legs import EDGE, Legs
from strapgen.navigation.vehicle.vehicle_motion import VehicleMotion
from strapgen.navigation.vehicle.vehicle_motion_names import TABLE

#: Time in s that a motion goes straight on first.
_STRAIGHT = 10.0
#: Period in s of the motion on one spot, and its largest roll and pitch in rad.
_PERIOD, _ROLL, _PITCH = 120.0, 0.3, 0.15
#: Lines that stand for a spectrum, spread evenly in the logarithm of frequency.
_LINES = 24
#: Steepest bank of a motion in rad.
_STEEPEST = math.radians(80)


def over_earth(
    name: str, latitude: float, longitude: float, height: float, controls: Controls, period: float = 0.0
) -> VehicleMotion:
    """Return a motion that begins at a place; angles in rad, the height in m."""
    if not abs(latitude) <= math.pi / 2:
        raise InputError(f"the latitude is {math.degrees(latitude):g} deg; -90 to 90 is needed")
    if not -1000 <= height <= 60000:
        raise InputError(f"the height is {height:g} m; -1000 to 60000 is needed")
    if not 0 <= controls.speed <= 1000:
        raise InputError(f"the speed is {controls.speed:g} m/s; 0 to 1000 is needed")
    return VehicleMotion(name, {}, controls=controls, start=(latitude, longitude, height), period=period)


def great_circle(
    latitude: float, longitude: float, height: float, heading: float, speed: float, name: str = "great-circle"
) -> VehicleMotion:
    """Return a flight straight on: on a sphere a great circle, on the ellipsoid a geodesic."""
    return over_earth(name, latitude, longitude, height, Controls(speed, heading))


def polar(latitude: float, longitude: float, height: float, heading: float, speed: float) -> VehicleMotion:
    """Return a flight straight on that begins near a pole."""
    return great_circle(latitude, longitude, height, heading, speed, "polar")


def turn(
    latitude: float, longitude: float, height: float, heading: float, speed: float, bank: float
) -> VehicleMotion:
    """Return a turn of constant radius, after ten seconds straight on."""
    rate = Legs.begun(speed, heading).bank_rate(_bank(bank))
    controls = Controls(speed, heading, turns=(Pulse(_STRAIGHT, math.inf, EDGE, rate),))
    return over_earth("turn", latitude, longitude, height, controls)


def climb(
    latitude: float, longitude: float, height: float, heading: float, speed: float, climb: float, top: float
) -> VehicleMotion:
    """Return a climb at a rate in m/s to another height in m, after ten seconds at the first one."""
    if climb <= 0:
        raise InputError(f"the climb rate is {climb:g} m/s; above 0 is needed, top_m tells up from down")
    legs = Legs.begun(speed, heading)
    legs.hold(_STRAIGHT)
    legs.climb(top - height, climb)
    return over_earth("climb", latitude, longitude, height, legs.controls)


def taxi(latitude: float, longitude: float, height: float, heading: float, speed: float) -> VehicleMotion:
    """Return a way over the ground: stand, roll, turn by 90 degrees to the right and to the left, and stop."""
    legs = Legs.begun(0.0, heading)
    legs.hold(_STRAIGHT)
    legs.accelerate(speed, 0.5)
    for angle in (math.pi / 2, -math.pi / 2):
        legs.hold(2 * _STRAIGHT)
        legs.turn(angle, math.radians(6), banks=False)
    legs.hold(2 * _STRAIGHT)
    legs.accelerate(0.0, 0.5)
    return over_earth("taxi", latitude, longitude, height, legs.controls)


def s_turns(
    latitude: float,
    longitude: float,
    height: float,
    heading: float,
    speed: float,
    bank: float,
    swing: float,
) -> VehicleMotion:
    """Return turns to and fro: a heading that swings as a sine by so much to each side, to a bank."""
    if not 0 < swing <= math.pi:
        raise InputError(f"the swing is {math.degrees(swing):g} deg; above 0 to 180 is needed")
    largest = STANDARD_GRAVITY * math.tan(_bank(bank)) / Legs.begun(speed, heading).speed
    wave = Waves(np.array([largest]), np.array([largest / swing]), np.zeros(1))
    # The integral of the rate is -swing at the start.
    controls = Controls(speed, heading + swing, turns=(wave,))
    return over_earth("s-turns", latitude, longitude, height, controls)


def swinging(
    latitude: float, longitude: float, height: float, heading: float, turn_rate: float
) -> VehicleMotion:
    """Return a vehicle on one spot whose heading swings with turns up to a rate, in roll and pitch."""
    swing, roll, pitch = (math.tau * turns / _PERIOD for turns in (10, 8, 6))
    waves = {
        "heading": (Waves(np.array([turn_rate / swing]), np.array([swing]), np.zeros(1)),),
        "roll": (Waves(np.array([_ROLL]), np.array([roll]), np.zeros(1)),),
        "pitch": (Waves(np.array([_PITCH]), np.array([pitch]), np.zeros(1)),),
    }
    return over_earth(
        "swinging", latitude, longitude, height, Controls(heading=heading, waves=waves), _PERIOD
    )


def shaken(motion: VehicleMotion, waves: dict[str, Waves]) -> VehicleMotion:
    """Return a motion with a vibration on top, by channel: angles about x and y, velocities along x and y."""
    names = {"angle_x": "roll", "angle_y": "pitch"}
    own = dict(motion.controls.waves)
    for channel, wave in waves.items():
        name = names.get(channel, channel)
        own[name] = (*own.get(name, ()), wave)
    return replace(motion, controls=replace(motion.controls, waves=own))


def _bank(bank: float) -> float:
    if not 0 < abs(bank) <= _STEEPEST:
        raise InputError(f"the bank is {math.degrees(bank):g} deg; up to 80 to either side is needed")
    return bank


def vibration(spectrum: Spectrum, seed: int = 1984) -> dict[str, Waves]:
    """Return sines with the power of a spectrum, by channel; those of one frequency keep their phases to each other."""
    edges = np.geomspace(spectrum.edges[0], spectrum.edges[-1], _LINES + 1)
    middle = np.rint(np.sqrt(edges[:-1] * edges[1:]) * _PERIOD) / _PERIOD
    size = np.sqrt(2 * spectrum.densities(middle) * np.diff(edges))
    random = np.random.default_rng(seed).uniform(0, math.tau, _LINES)
    return {
        name: Waves(size * np.abs(transfer), math.tau * middle, random + np.angle(transfer))
        for name, transfer in spectrum.amplitudes(middle).items()
    }


def named(name: str, settings: Mapping[str, Any]) -> VehicleMotion:
    """Return a motion over the earth by its name or file; refuse another motion."""
    found = any_motion(name, 1, settings)
    if not isinstance(found, VehicleMotion):
        kinds = ", ".join(TABLE)
        raise InputError(f"motion {name} is none over the earth; {kinds}, or a file of a course, is needed")
    return found
