"""Bad input on the command line: exit 2, one line on stderr that says what is wrong, nothing done."""

from __future__ import annotations

import shlex
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from strapgen.cli import main
from strapgen.results import figures

# A warning would be a second line on stderr.
pytestmark = pytest.mark.filterwarnings("error")

DATA = Path(__file__).resolve().parents[1] / "data"
TIMES = "--step 0.125 --duration 1"
CONSTANT = f"--motion constant --set x_deg_s=1 {TIMES}"
CONING = "--motion coning --step 0.125 --duration 1 --set"
EVEN = f"--input instants --recording {DATA}/rates_even.csv"


def at(hertz: object, amplitude: object = 1, step: object = 0.01) -> str:
    """Return the options of a vibration."""
    return f"--step {step} --frequency-hz {hertz} --theta-x-rad {amplitude} --phase-rad 1"


WAVE = at(10)
ASSESSED = (
    "allowed: dcm, euler, cayley-klein, rotation-vector, sculling, velocity-position, coning-fast, sculling-fast-1, "
    "sculling-fast-2, two-speed-fast-1, two-speed-fast-2, two-speed, or a Python file"
)

LOG = f"--recording {DATA.parents[1]}/examples/inertial_log.csv"

BAD = {
    # Two speeds, generated
    "two-speed": "Missing argument",
    "two-speed cayley-klein": "algorithm 'cayley-klein' is not known; allowed: dcm, euler",
    "two-speed dcm --sculling 3": "sculling is 3; a whole number from 1 to 2",
    "two-speed dcm --target numpy": "target 'numpy' is not known; allowed: c, c-float, c-fixed",
    "two-speed dcm --word 16": "go with --target c-fixed, not with c",
    "two-speed dcm --carry full": "go with --target c-fixed, not with c",
    "two-speed dcm --target c-float --drift-allowance 0.1": "go with --target c-fixed, not with c-float",
    "two-speed dcm --target c-fixed --carry p": "carry 'p' is not known; allowed: none, state, full",
    "two-speed dcm --target c-fixed --drift-allowance 2": "drift allowance is 2; more than 0 and at most 0.5 is needed",
    "two-speed dcm --target c-fixed --word 24": "word",
    "two-speed dcm --target c-fixed --range arm=1": "no loop has an input 'arm'",
    "two-speed dcm --target c-fixed --sample-hz 400": "--sample-hz needs --max-rate-deg-s or --lsb",
    "two-speed dcm --target c-fixed --lsb 1mdps": "--lsb needs --sample-hz or --step",
    "two-speed dcm --target c --lsb-rad 1e-6": "go with --target c-fixed, not with c",
    "two-speed dcm --target c-fixed --max-rate-deg-s 9 --sample-hz 9 --range increment=1": "are both stated; one is",
    "system two-speed-dcm --target c-fixed --lsb 1mdps --lsb-rad 1e-6": "--lsb and --lsb-rad are both given",
    "system two-speed-dcm --target c-fixed --lsb 9": "lsb is '9'; a number with its unit is needed",
    f"system {DATA.parents[1]}/examples/strapdown.toml --target c-fixed --lsb 1mdps": "no input of strapdown",
    "two-speed dcm --format csv": "format 'csv' is not known",
    # Constants
    "derive temperature-coefficient --constant nominal": "--constant 'nominal' is no setting; NAME=VALUE is needed",
    "derive temperature-coefficient --constant nominal=1,": "constant nominal is ''; a finite number is needed",
    "generate imu-compensate --constant cylce=1": "constant 'cylce' is not known (did you mean cycle?)",
    "generate imu-compensate --constant cycle=1 --constant cycle=2": "--constant cycle is given twice; one is needed",
    "generate --all --constant cycle=1": "--all generates the whole catalogue; --constant does not go with it",
    "cost --all --constant cycle=1": "--all measures the whole catalogue in fixed point; --constant does not go with",
    "vectors euler --constant state=0,0,0,1": "algorithm euler takes no constants (got state)",
    # Numbers as Python alone writes them
    "derive euler --increments 0_2": "increments is '0_2'; a whole number is needed",
    "generate euler --target c-fixed --word 3_2": "word is '3_2'; a whole number is needed",
    "generate euler --target c-fixed --max-angle-rad 0.1_2": "--max-angle-rad is '0.1_2'; a finite number is needed",
    "study word-length --words 1_6": "word is '1_6'; a whole number is needed",
    f"strapdown dcm {LOG} --fast-cycles 4 --initial-deg 1,2,1_0": "initial-deg is '1_0'; a finite number is needed",
    # The rate table
    "stress --duration 0": "duration is 0",
    "stress --duration long": "duration is 'long'",
    "stress --duration 20 --sample 0.3": "multiple",
    "stress --algorithms bortz": "algorithm 'bortz' is not known; allowed: dcm, euler, cayley-klein, two-speed",
    "stress --algorithms ,": "--algorithm is ','; at least one value is needed",
    "stress --backends c-q7": "backend 'c-q7' is not known",
    "stress --carry some": "carry 'some' is not known",
    "stress --format html": "format 'html' is not known; allowed: text, json, csv, markdown, latex",
    # Along a recording in two speeds
    "strapdown dcm": "one of --recording, --motion is needed; none given",
    f"strapdown dcm {LOG}": "fast-cycles is missing; an algorithm in two speeds needs it",
    "strapdown dcm --recording nowhere.csv --fast-cycles 4": "nowhere.csv cannot be read",
    f"strapdown dcm --recording {DATA}/increments.csv --fast-cycles 4": "no velocity increments along three axes",
    f"strapdown dcm {LOG} --fast-cycles four": "fast-cycles is 'four'; a whole number is needed",
    f"strapdown dcm {LOG} --fast-cycles 4 --slow-cycles 999": "a navigation cycle needs 3996",
    f"strapdown cayley-klein {LOG} --fast-cycles 4": "algorithm 'cayley-klein' is not known; allowed: dcm, euler",
    f"strapdown dcm {LOG} --fast-cycles 4 --initial-deg 1,2": "three numbers with commas between are needed",
    f"strapdown dcm {LOG} --fast-cycles 4 --word 16": "--word is for fixed-point back ends, not for numpy",
    f"strapdown dcm {LOG} --fast-cycles 4 --frame-rate-deg-h 1e300,0,0": "the attitude does not stay finite",
    f"strapdown dcm {LOG} --fast-cycles 4 --format xml": "format 'xml' is not known; allowed: text, json, csv, ",
    # Series
    "series": "an algorithm is needed, or --all",
    "series eulr": "algorithm 'eulr' is not known",
    "series euler --motion spin": "motion 'spin' is not known; allowed: general, constant",
    "series euler --terms 0": "terms is 0; a whole number from 1 to 6",
    "series euler-normalize": "algorithm 'euler-normalize' is no attitude step",
    "series euler --format yaml": "format 'yaml' is not known; allowed: text, json, latex",
    "series euler --versus-method rk1": "--versus-method needs --versus",
    "series euler --plot drift.png": "--plot needs a --motion of the catalogue",
    "series euler --motion coning --plot drift.xyz": "file type 'xyz' is not known",
    "series euler --motion coning --set a_deg_s=1": "--set needs --plot",
    "series euler --motion coning --plot a.png --set a_deg_s=1": "motion coning lacks b_deg_s or b_rad_s",
    "series euler --motion coning --plot a.png --steps 1/8,1/12": "the longest step",
    "series euler --motion coning --plot a.png --out a.png": "two files are needed",
    "series --all --versus euler": "--all and --versus do not go together",
    "series --all --method heun": "method 'heun' is not known",
    "derive euler --format latex --show nothing": "show 'nothing' is not known; allowed: text, latex, program",
    "stability euler --method heun": "method 'heun' is not known",
    "stability euler --method ,": "--method is ','; at least one value is needed",
    "stability euler --plot a.xyz": "file type 'xyz' is not known",
    "tables --predict --backend c": "--predict and --backend do not go together",
    "tables --predict --table 1": "--predict and --table do not go together",
    # Commands and options
    "simulat": "No such command 'simulat' (did you mean simulate?). Allowed: list, derive, ",
    "study wordlength": "No such command 'wordlength' (did you mean word-length?). Allowed: word-length, ",
    "simulate euler --methods rk4": "No such option: --methods (did you mean --method?); --help shows all",
    "simulate euler --method": "--method needs a value, NAME: integration method; strapgen list methods shows all",
    "simulate euler --method --increments 2": "--method needs a value, NAME: integration method",
    "simulate euler --method rk2,rk4": "--method rk2,rk4 is a list; one name is needed here",
    f"simulate euler {CONSTANT} --order scam": "order 'scam' is not known (did you mean scan?)",
    f"simulate euler {CONSTANT} --order scan": "order is scan; it goes with the back ends c and c-float, not with",
    f"simulate two-speed-euler --order scan {CONSTANT}": "--order",
    f"simulate euler --backend c,numpy {CONSTANT}": "--backend c,numpy is a list; one name is needed here",
    f"simulate euler {CONSTANT} --plot -": "--plot - is no file",
    # Names that other people use
    "derive quaternion": "algorithm 'quaternion' is not known (did you mean euler?)",
    "derive 'Direction cosines'": "(did you mean dcm?)",
    "derive euler --method Runge-Kutta": "method 'Runge-Kutta' is not known (did you mean rk4?)",
    "derive euler --method heun": "method 'heun' is not known (did you mean rk2?)",
    "generate euler --target float": "target 'float' is not known (did you mean c-float?)",
    f"simulate ck {CONSTANT}": "algorithm 'ck' is not known (did you mean cayley-klein?)",
    f"simulate euler --backend c-fixed {CONSTANT}": "(did you mean c-fixed32 or c-fixed16?)",
    "simulate euler --motion conical --step 1 --duration 1": "motion 'conical' is not known (did you mean coning?)",
    "integrate": "No such command 'integrate'",
    "list --formatt json": "No such option: --formatt (did you mean --format?); --help shows all",
    "list euler": "kind 'euler' is not known; allowed: algorithms, methods",
    # converge and check
    "converge euler --method rk9": "method 'rk9' is not known",
    "converge euler --steps 1/8": "a slope takes two steps or more",
    "converge euler --steps 1/8,1/x": "step is '1/x'; a finite number is needed",
    "converge euler --steps 1/8,1/16 --duration 0.3": "is not a whole multiple of the step",
    "converge euler --backend fast": "backend 'fast' is not known; allowed: numpy, ",
    "converge euler --motion spin": "motion 'spin' is not known; allowed: constant",
    "converge euler --motion constant": "motion constant needs parameters",
    "converge euler --fail-beyond -1": "fail-beyond is -1",
    "converge euler --out a --plot a": "--out and --plot are both a",
    "generate euler --target c --out -": "--out - prints one file; --file chooses it of euler_rk4_2.h, euler_rk4_2.c",
    "system imu --out -": "--out - is no folder; files are not written to the terminal",
    "converge euler --method rk1 --steps 1/2,1/4 --plot a.docx": "file type 'docx' is not known",
    "converge euler --method rk4 --tableau x.toml": "are both given; one is needed",
    "check none.py": "none.py is no file",
    # vibration
    "vibration euler": "--step in s is needed",
    "vibration euler --step 0.01": "--frequency-hz is needed, or a --spectrum",
    f"vibration euler {WAVE}": "--theta-y-rad is needed for the drift, or --acceleration-y for sculling",
    f"vibration rk4 {WAVE} --theta-y-rad 1": f"algorithm 'rk4' is not known; {ASSESSED}",
    **{
        f"vibration {name} {WAVE} --theta-y-rad 1 {more}": f"algorithm '{name}' has no rate under vibration; {ASSESSED}"
        for name, more in (
            ("error-matrix", ""),
            ("euler-update", "--increments 2"),
            ("dcm-update", "--method rk4"),
            ("coning-slow", "--increments 10"),
            ("dcm-two-speed-slow-2", ""),
        )
    },
    f"vibration euler {WAVE} --theta-y-rad 1 --method rk9": "method 'rk9' is not known",
    f"vibration euler {WAVE} --theta-y-rad far": "theta-y-rad is 'far'; a finite number is needed",
    f"vibration euler {WAVE} --theta-y-rad 1 --plot-hz 1,2": "--plot-hz needs --plot",
    f"vibration euler {WAVE} --theta-y-rad 1 --plot a.png --plot-hz 1": "--plot-hz is '1'; two numbers with commas",
    f"vibration euler {WAVE} --theta-y-rad 1 --plot a.docx": "file type 'docx' is not known",
    f"vibration euler {at(0)} --theta-y-rad 1": "frequency-hz is 0; a number above 0 is needed",
    f"vibration euler {at(100)} --theta-y-rad 1 --method rk1": "euler-rk1-2 has no mean rate",
    f"vibration coning-fast {WAVE} --theta-y-rad 1": "--increments must say how many of its cycles make a step",
    f"vibration two-speed {WAVE} --theta-y-rad 1": "two-speed is in two speeds: --increments must say how many",
    f"vibration two-speed {WAVE} --theta-y-rad 1 --increments 9 --method rk4": "two-speed takes no --method",
    f"vibration two-speed {WAVE} --theta-y-rad 1 --increments 9 --rates": "two-speed takes no --rates",
    f"vibration coning-fast {WAVE} --acceleration-y 1 --increments 9": "drift rates alone; --theta-y-rad is needed",
    f"vibration sculling {WAVE} --theta-y-rad 1": "sculling rates alone; --acceleration-y is needed",
    f"vibration euler {WAVE} --spectrum a.csv": "--spectrum and --frequency-hz do not go together",
    **{
        f"vibration euler {WAVE} --theta-y-rad 1 --plot a.png --plot-hz {span}": said
        for span, said in (
            (
                "1,1e300",
                "plot-hz is 1e+300; a plot takes 0.0002 to 20000 Hz, 1e-06 to 100 times the sampling",
            ),
            ("1e-300,1", "plot-hz is 1e-300; a plot takes 0.0002 to 20000 Hz"),
            ("1,far", "plot-hz is 'far'; a finite number is needed"),
        )
    },
    f"vibration euler {at('1e9')} --theta-y-rad 1 --plot a.png": "frequency-hz is 1e+09; a plot takes",
    f"vibration euler {at(10, step='1e-310')} --theta-y-rad 1 --plot a.png": "a plot takes",
    f"vibration euler {WAVE} --acceleration-y ''": "acceleration-y is ''; a finite number is needed",
    f"vibration euler {at(1000, '1e150')} --theta-y-rad 1e154": (
        "euler-rk4-2: the error in deg/h is beyond the range of double; take smaller amplitudes"
    ),
    "vibration euler --step 0.005 --spectrum wide.csv": "over 100000 panels to integrate",
    "vibration euler --step 0.005 --spectrum huge.csv": "the spectrum is not finite at",
    "vibration euler --step 0.005 --spectrum strong.csv": "the integral of the spectrum is beyond the range of double",
    "vibration euler --step 0.005 --spectrum loud.csv": "the error in deg/h is beyond the range of double",
    "vibration euler --step 0.01 --spectrum loud.csv --format latex": "--spectrum and --format latex do not go",
    "vibration euler --step 0.01 --spectrum none.csv": "none.csv cannot be read (No such file or directory)",
    # tableau
    "tableau rk9": "method 'rk9' is not known (did you mean rk1, rk2 or rk3?); allowed: rk1, rk2, midpoint, ",
    "tableau rk4 --format html": "format 'html' is not known (did you mean toml?); allowed: text, json, csv, markdown",
    "tableau none.toml": "none.toml cannot be read (No such file or directory)",
    "tableau ./file": "./file is not TOML (",
    "tableau heun.toml": "heun.toml: order 3: sum b_i c_i^2 = 1/2, 1/3 is needed (off by 1/6)",
    "tableau implicit.toml": "implicit.toml: matrix[1] has 1 entry: not explicit, 0 are needed",
    # coning, and vectors of a step
    "coning": "Missing option '--samples'",
    "coning --samples 0": "samples is 0; a whole number from 1 to 8 is needed",
    "coning --samples 2 --previous 33": "previous is 33; a whole number from 0 to 32 is needed",
    "coning --samples 8 --previous 10 --form combined": "at most 17 are allowed for combined coefficients",
    "coning --samples 2 --form optimal": "form 'optimal' is not known; allowed: compressed, uncompressed, combined",
    "coning --samples 6 --previous 1 --terms": "are listed for up to 6 samples; 7 are given",
    "coning --samples 2 --format toml": "--format toml needs --objective",
    "derive rotation-vector --method rk4": "method of rotation-vector 'rk4' is not known; allowed: magnus2, magnus4",
    "derive rotation-vector --tableau kutta.toml": "rotation-vector goes with no tableau; allowed methods: magnus2",
    "derive sculling --method magnus4": "method of sculling 'magnus4' is not known; allowed: coning-compressed",
    "derive sculling --rates": "method coning-combined takes increments; rates at nodes do not go with it",
    "derive velocity-position --rates": "velocity-position takes increments; rates at nodes do not go",
    "derive velocity-position --method rk99": "method of velocity-position 'rk99' is not known; allowed: rk1, rk2",
    "series velocity-position --motion constant": "series of velocity-position hold for any motion; --motion, --versus",
    "study velocity-position --method two-speed:x": "number of samples in two-speed:x is 'x'; a whole number is needed",
    "study velocity-position --backend cobol": "backend 'cobol' is not known; allowed: numpy",
    "study velocity-position --carry full": "--carry goes with a back end of fixed point, not with numpy",
    "study velocity-position --force push": "force 'push' is not known; allowed: constant, random, oscillation, lever",
    "study velocity-position --force lever": "force lever needs parameters; allowed: x_m, y_m, z_m",
    "study velocity-position --force oscillation --force-set x_g=1": "force oscillation lacks frequency_hz",
    "study velocity-position --force-set rms_m_s2=1 rms_g=1": "rms_m_s2 and rms_g are both given; one is needed",
    "study velocity-position --force-set rms": "--force-set 'rms' is no setting; NAME=VALUE is needed",
    "study velocity-position --force oscillation --force-set frequency_hz=0": "frequency_hz is 0; a number above 0",
    "study velocity-position --motion swing": "motion 'swing' is not known (did you mean swinging?); allowed: constant",
    "study velocity-position --duration 0.015": "duration 0.015 s is not a whole multiple of the sampling interval",
    "derive euler --method coning-compressed --rates": "rates at nodes do not go with it",
    # derive
    "check": "Missing argument 'ALGORITHM': dcm, euler or cayley-klein, or a Python file of your own",
    "generate sculling --target c-fixed": "the range of input velocity_increments is not known",
    "generate constant-truth --target c-fixed": "the range of input time is not known",
    "derive euler --tableau .": ". cannot be read (Is a directory)",
    "derive euler --increments 0": "increments is 0; a whole number from 1 to 8 is needed",
    "derive euler --previous -1": "previous is -1; a whole number from 0 to 32 is needed",
    "generate euler --target c-fixed --word 7": "word is 7; a whole number of bits from 8 to 64 is needed",
    "derive euler --method rk4 --tableau kutta.toml": "--method and --tableau are both given; one is needed",
    "tables --backend c --carry full": "--rounding and --carry are for fixed-point back ends, not for c",
    "derive eulr": "algorithm 'eulr' is not known (did you mean euler?); allowed: dcm, euler, cayley-klein, ",
    "derive euler --method rk5": "method 'rk5' is not known (did you mean rk1, rk2 or rk3?); allowed: rk1, rk2, ",
    "derive euler --show html": "show 'html' is not known; allowed: text, latex, program, operations",
    "derive euler --format csv": "--format csv needs --show program or operations",
    "derive euler-product --method rk4": "kernel euler-product takes no method (got rk4)",
    "derive euler --rates --increments 2": "a step takes increments or rates, not both",
    "derive euler-product --rates": "kernel euler-product takes no rates",
    "generate --all --rates": "--rates does not go with it",
    "compare euler --rates --motion constant": "No such option: --rates",
    "simulate euler --rates --recording large.csv": "--rates needs --motion",
    "simulate euler --print 1 --recording large.csv": "--print needs --motion",
    f"simulate euler --print 1 --format csv {CONSTANT}": "--print and --format csv do not go together",
    f"simulate euler --print 0.3 {CONSTANT}": "print 0.3 s is not a whole multiple of the record interval",
    f"simulate euler --initial-deg 1,2,x {CONSTANT}": "initial-deg is 'x'",
    f"simulate euler --rates --pulse-arcsec 1 {CONSTANT}": "kernel euler-rk4-rates takes rates; a pulse goes with",
    f"simulate euler --motion missing.py {TIMES}": "motion missing.py is no file; a Python file with functions",
    "converge euler --motion missing.py": "motion missing.py is no file",
    "converge euler --backend numpy --motion missing.py": "motion missing.py is no file",
    f"compare euler --motion missing.py {TIMES}": "motion missing.py is no file",
    "study word-length --motion missing.py": "motion missing.py is no file",
    "derive euler-product --increments 2": "kernel euler-product takes no increments (got 2)",
    "derive euler --method taylor4 --rates": "method taylor4 takes increments; rates at nodes do not go with it",
    "generate dcm --method taylor20 --rates --target c": "method taylor20 takes increments; rates at nodes do not",
    # previous increments
    "derive euler --ahead 33": "ahead is 33; a whole number from 0 to 32 is needed",
    "derive euler --previous 20 --ahead 13": "previous 20 and ahead 13 are 33 together; at most 32 are allowed",
    "derive euler --method coning-combined --ahead 1": "method coning-combined takes no increments ahead",
    "derive euler --rates --ahead 2": "a step takes increments or rates, not both (got 2 ahead and rates)",
    "derive euler --rates --previous 2": "a step takes increments or rates, not both (got 2 previous ones and rates)",
    "derive euler-product --previous 1": "kernel euler-product takes no previous (got 1)",
    "derive euler-product --ahead 1": "kernel euler-product takes no ahead (got 1)",
    "generate --all --previous 1": "--previous does not go with it",
    "simulate euler --method rk1 --previous 3 --recording short.csv": "the recording holds 3 increments; a step",
    "compare euler --method rk1 --previous 3 --recording short.csv": "holds 3 increments; a step needs 5",
    # a tableau of a file
    "derive euler --tableau none.toml": "none.toml cannot be read (No such file or directory)",
    "derive euler --tableau file": "file is not TOML (",
    "derive euler --tableau heun.toml": "heun.toml: order 3: sum b_i c_i^2 = 1/2, 1/3 is needed (off by 1/6)",
    "derive euler --tableau implicit.toml": "implicit.toml: matrix[1] has 1 entry: not explicit, 0 are needed",
    "derive euler --tableau row.toml": "row.toml: matrix row 2 sums to 1/2; its node is 1",
    "generate dcm --tableau heun.toml --increments 4 --target c --out out": "heun.toml: order 3: sum b_i c_i^2 = 1/2",
    "generate dcm --tableau comment.toml --target c": "comment.toml: source holds */, which has a meaning in generated",
    "derive euler-product --tableau kutta.toml": "kernel euler-product takes no method (got euler); these do",
    f"simulate euler --tableau heun.toml {CONSTANT}": "heun.toml: order 3: sum b_i c_i^2 = 1/2, 1/3 is needed",
    "generate --all --tableau kutta.toml": "--tableau does not go with it",
    # algorithms of users
    "derive none.py": "algorithm none.py is no file; a Python file with a function algorithm is needed",
    "derive empty.py": "empty.py defines no function algorithm; one that returns a Kernel is needed",
    "derive raises.py": "raises.py, line 2: ValueError: one two",
    "generate raises.py --target c": "raises.py, line 2: ValueError: one two",
    "derive broken.py": "broken.py, line 1: SyntaxError: ",
    "derive nonsense.py": "nonsense.py: algorithm() returned int; a Kernel is needed",
    "derive nonsense.py --method rk4": "nonsense.py: its algorithm() takes no method; it takes no options",
    "derive nonsense.py --rates": "nonsense.py: rates at nodes go with methods of the catalogue",
    f"simulate nonsense.py {CONSTANT}": "nonsense.py: algorithm() returned int; a Kernel is needed",
    f"compare none.py {CONSTANT}": "algorithm none.py is no file",
    # fixed point
    "generate --all --carry full": "--all generates the whole catalogue; --carry does not go with it",
    "generate euler --target c-fixed --word 24": "word is 24; in C it is 16, 32, 64 bits",
    "generate euler --target c-fixed --max-rate-deg-s 400": "--max-rate-deg-s needs --step or --sample-hz",
    "generate euler --target c-fixed --step 0.01": "--step needs --max-rate-deg-s or --lsb",
    "generate euler --target c-fixed --sample-hz 100": "--sample-hz needs --max-rate-deg-s or --lsb",
    "generate euler --target c-fixed --sample-hz 100 --step 1 --max-rate-deg-s 4": "--step and --sample-hz are both",
    "generate euler --target c-fixed --sample-hz 0 --max-rate-deg-s 4": "sample-hz is 0; a number above 0 is needed",
    "generate euler --target c-fixed --lsb 0.0175dps": "--lsb needs --sample-hz or --step",
    "generate euler --target c-fixed --lsb 0.0175 --sample-hz 100": "lsb is '0.0175'; a number with its unit is needed",
    "generate euler --target c-fixed --lsb 1dpx --sample-hz 100": "lsb is '1dpx'; a number with its unit is needed",
    "generate euler --target c-fixed --lsb xdps --sample-hz 100": "lsb is 'xdps'; a number with its unit is needed",
    "generate euler --target c-fixed --lsb 1dps --lsb-rad 1 --sample-hz 9": "--lsb and --lsb-rad are both given",
    "generate euler --target c-fixed --lsb 3e-6rad --sample-hz 9": "an angle a count; --lsb-rad takes it",
    "generate euler --target c-fixed --lsb 1dps --sample-hz 9": "rad (--sample-hz 9, lsb 1dps); from 1e-11 to 4 is",
    "generate euler --target c-fixed --lsb-rad 1e-6 --input-bits 48": "input bits is 48; a whole number from 8 to 32",
    "generate euler --target c-fixed --lsb-rad 1e-6 --fix increments=Q0.31": "the format of increments follows from",
    "generate euler --target c-fixed --rates --lsb-rad 1e-6": "takes no increments; --lsb-rad does not go with it",
    "generate euler-normalize --target c-fixed --input-bits 16": "takes no increments; --input-bits does not go with",
    "generate euler --target c-fixed --state q7": "state 'q7' is not known; allowed: q15, q31, q63",
    "generate euler --target c-fixed --word 16 --state q31": "state q31 has 32 bits and the word 16; q15 is needed",
    "generate euler --target fixed-model --word 24 --state q31": "the word 24; a word of 16, 32 or 64 bits is needed",
    "generate euler --target c-fixed --state q31 --drift-allowance 1/8": "a drift allowance does not go with state q31",
    "generate euler --target c-fixed --state q31 --fix state=Q1.30": "a format of the state does not go with state q31",
    f"simulate euler --backend c-fixed32 --lsb-rad 1e-6 --pulse-arcsec 3 {CONSTANT}": "--pulse-arcsec and --lsb-rad",
    f"compare euler --backend c --lsb-rad 1e-6 {CONSTANT}": "--lsb-rad is for fixed-point back ends",
    "generate euler --target c-fixed --max-rate-deg-s x --step 1": "max-rate-deg-s is 'x'; a finite number",
    "generate euler --target c-fixed --max-rate-deg-s -4 --step 1": "max-rate-deg-s is -4; a number above 0",
    "generate euler --target c-fixed --max-rate-deg-s 1e6 --step 1": "from 1e-11 to 4 is needed",
    "generate euler --target c-fixed --max-angle-rad 1 --max-rate-deg-s 1 --step 1": "both given; one is needed",
    "generate euler --target c-fixed --rounding up": "rounding 'up' is not known; allowed: nearest, truncation",
    "generate euler --target c-fixed --carry p": "carry 'p' is not known; allowed: none, state, full",
    "generate euler --target c-fixed --drift-allowance 2": "drift allowance is 2",
    "generate euler --target c-fixed --fix p_x": "--fix 'p_x' is no setting; NAME=VALUE is needed",
    "generate euler --target c-fixed --fix p_x=Q1.2": "format Q1.2 has 4 bits with its sign; 32 are needed",
    "generate euler --target c-fixed --fix p_x=Q-9.40": "format Q-9.40 of p_x does not hold its range",
    "generate euler --target c-fixed --fix q=Q1.30": "has no value 'q'; its values are: state, increments",
    "generate euler --target c-fixed --range speed=1": "has no input 'speed'; its inputs are: state, increments",
    "generate euler --target c-fixed --max-angle-rad 1e-30": "rad; from 1e-11 to 4 is needed",
    "generate euler --target c-fixed --max-rate-deg-s 1e300 --step 1": "(--max-rate-deg-s 1e300, step 1); from 1e-11",
    "generate euler --target c-fixed --range state=9": "the range of state follows from the drift allowance",
    "generate euler-from-dcm --target c-fixed --max-rate-deg-s 5 --step 0.1": "takes no increments",
    "generate euler-from-dcm --target c-fixed --carry full": "--carry keeps nothing",
    f"compare euler --word 24 {CONSTANT}": "--word is for the back end fixed-model",
    f"compare euler --fail-above -1 {CONSTANT}": "fail-above is -1; a number that is not below 0 is needed",
    f"simulate euler --carry full {CONSTANT}": "--carry is for fixed-point back ends, not for numpy",
    f"simulate euler --backend c-fixed32 --max-rate-deg-s 0.1 {CONSTANT}": "increments holds 0.0010908",
    f"simulate dcm --method rk1 --backend c-q31 {CONING} a_deg_s=900 b_deg_s=1 g_deg_s=1": "refuses its input in step",
    f"simulate euler --pulse-arcsec 0 {CONSTANT}": "pulse-arcsec is 0; a number above 0 is needed",
    # compare
    "compare euler": "one of --motion, --recording is needed; none given",
    f"compare euler --backends c,fortran {CONSTANT}": "backend 'fortran' is not known; allowed: numpy, c, c-float",
    f"compare euler --backends , {CONSTANT}": "--backend is ','; at least one value is needed",
    f"compare euler --reference truth {CONSTANT}": "reference 'truth' is not known (did you mean exact?); allowed",
    f"compare euler --fail-above much {CONSTANT}": "fail-above is 'much'; a finite number is needed",
    "compare euler --motion constant --step 1 --duration 2": "motion constant needs parameters",
    "compare euler --motion constant --set x_deg_s=1 --step 1": "--motion needs --duration",
    # frontier
    "report --method rk4": "--method needs ALGORITHM...",
    "report euler --motion conin": "motion 'conin' is not known",
    "report euler --set a=1": "--set needs --motion",
    "report euler --sample-hz 0": "sample-hz is 0; a number above 0 is needed",
    "report euler --duration 0.001 --beside rk4:2": "duration 0.001 s is shorter than a step",
    "report euler-product --word 17 --backend numpy": "word",
    "report raises.py --out raises.py": "raises.py is a file that the command reads",
    "report euler-product --out file/report.html": "file cannot be written",
    "frontier --method rk4:2 --set a=1": "--set needs --motion",
    "frontier --method rk4:2 --duration 0.001": "duration 0.001 s is shorter than a step of rk4:2 at 100 Hz",
    "frontier --method rk4:2 --jobs 0": "jobs is 0; a whole number from 1 to 1024 is needed",
    f"simulate euler --motion slew --set onset_s=9 {TIMES}": "onset_s is 9; 0.0001 to 1.2 is needed",
    f"simulate euler --motion vibration --set gyro_hz=4 {TIMES}": "motion vibration lacks angle_deg or angle_rad",
    # study
    "study": "Missing command. Allowed: word-length",
    "study length": "No such command 'length'",
    "study word-length --words 8,70": "word is 70",
    "study word-length --words ,": "--word is ','; at least one value is needed",
    "study word-length --steps 0.7": "duration 180 s is not a whole multiple of the step 0.7 s",
    "study word-length --motion constant": "--motion constant needs --set",
    "study word-length --pulses-arcsec -1": "--pulse-arcsec is -1; a number that is not below 0 is needed",
    # generate
    "generate": "an algorithm is needed, or --all",
    "generate euler --increments 9": "increments is 9",
    "generate euler --target basic": "target 'basic' is not known; allowed: numpy, c, c-float",
    "generate --check": "an algorithm is needed, or --all",
    "generate euler --target numpy --name step": "--name goes with targets in C, C++, Rust and MATLAB, not with numpy",
    "generate euler --target c --name 2step": "--name is '2step'; letters, digits and underscores are needed",
    "generate euler --target c --name step --prefix a_": "--name and --prefix are both given",
    f"generate euler --target c --prefix {'a' * 20}": "a name of at most 27 characters is needed",
    "generate euler --target c --name printf": "neither c, c++ nor the c library has",
    "generate euler --with-runs": "--with-runs goes with targets in C, C++, Rust and MATLAB, not with numpy",
    "generate --all --with-runs": "--with-runs does not go with it",
    "generate euler --all": "ALGORITHM and --all are both given; one is needed",
    "generate --all --method rk4": "--method does not go with it",
    "generate --all --increments 2": "--increments does not go with it",
    "generate --all --target cobol": "target 'cobol' is not known",
    "generate --all --target cpp --project": "--project does not go with it",
    "generate euler --target cpp,cobol": "target 'cobol' is not known",
    "generate euler --target cpp --project": "--project goes with targets in C, not with cpp",
    "generate --all --check --out none": "none is no folder; --check needs the one to look at",
    "generate euler --target ''": "--target is ''; at least one value is needed",
    "generate euler --out file": "file cannot be written",
    "generate euler --out file/folder": "file/folder cannot be written: it is a file, or lies below one",
    "generate euler --out /proc/strapgen": "/proc/strapgen cannot be written",
    "generate --all --out file/folder": "file/folder cannot be written",
    # simulate: names
    f"simulate eulr {CONSTANT}": (
        "algorithm 'eulr' is not known (did you mean euler?); allowed: dcm, euler, cayley-klein, or a Python file"
    ),
    f"simulate euler --increments 9 {CONSTANT}": "increments is 9",
    f"simulate dcm {CONSTANT} --scheme optimal": "'optimal' is not known (did you mean dcm-orthonormalize-optimal?)",
    # simulate: parameters of the motion
    f"simulate euler --motion constant --set w_deg_s=1 {TIMES}": "'w_deg_s' is not known (did you mean x_deg_s",
    f"simulate euler --motion constant {TIMES}": "motion constant needs parameters; allowed: x_deg_s",
    f"simulate euler {CONING} a_deg_s=1 b_deg_s=1": "motion coning lacks g_deg_s or g_rad_s",
    f"simulate euler {CONING} a_deg_s=1 g_deg_s=1": "motion coning lacks b_deg_s or b_rad_s",
    f"simulate euler {CONING} a_deg_s=1 b_deg_s=1 b_rad_s=1 g_deg_s=1": "b_deg_s and b_rad_s are both given",
    f"simulate euler {CONING} a_deg_s=1 a_deg_s=2": "--set a_deg_s is given twice",
    f"simulate euler {CONING} a_deg_s": "--set 'a_deg_s' is no setting; NAME=VALUE is needed",
    f"simulate euler {CONING} =1": "--set '=1' is no setting; NAME=VALUE is needed",
    f"simulate euler {CONING} a_deg_s=": "--set 'a_deg_s=' is no setting; NAME=VALUE is needed",
    f"simulate euler {CONING} a_deg_s=fast": "a_deg_s is 'fast'; a finite number is needed",
    f"simulate euler {CONING} a_deg_s=-inf b_deg_s=1 g_deg_s=1": "a_deg_s is '-inf'; a finite number",
    f"simulate euler {CONING} a_deg_s=1e999 b_deg_s=1 g_deg_s=1": "a_deg_s is '1e999'; a finite number",
    f"simulate euler --motion constant --set x_deg_s=1e300 {TIMES}": "the increments are too large",
    f"simulate dcm --motion constant --set x_deg_s=1e300 {TIMES} --backend c": "the increments are too large",
    f"simulate dcm --motion constant --set x_deg_s=1e60 {TIMES} --backend c-float": "beyond the range of float32",
    # simulate: times
    "simulate euler --motion constant --set x_deg_s=1 --duration 1": "--motion needs --step in s",
    "simulate euler --motion constant --set x_deg_s=1 --step 1": "--motion needs --duration",
    **{
        f"simulate euler --motion constant --set x_deg_s=1 --step {step} --duration 1": said
        for step, said in {
            "0": "step is 0; a number above 0 is needed",
            "-0.1": "step is -0.1; a number above 0 is needed",
            "nan": "step is 'nan'; a finite number is needed",
            "inf": "step is 'inf'; a finite number is needed",
            "short": "step is 'short'; a finite number is needed",
            "''": "step is ''; a finite number is needed",
            "1/0": "step is '1/0'; a finite number is needed",
            "0.3": "duration 1 s is not a whole multiple of the step 0.3 s (their ratio is 3.33333333)",
            "2": "duration 1 s is not a whole multiple of the step 2 s",
            "1e-15": "that is too many",
            "1e-400": "step is 1e-400; a number above 0 is needed",
            "1e-999999999": "a number above 0 is needed",
        }.items()
    },
    "simulate euler --motion constant --set x_deg_s=1 --step 1 --duration 0": "duration is 0; a number above 0",
    "simulate euler --motion constant --set x_deg_s=1 --step 1 --duration inf": "duration is 'inf'; a finite",
    f"simulate euler {CONSTANT} --orthonormalize 0.3": "orthonormalize 0.3 s is not a whole multiple of the step",
    f"simulate euler {CONSTANT} --orthonormalize 0": "orthonormalize is 0; a number above 0 is needed",
    f"simulate euler {CONSTANT} --orthonormalize nan": "orthonormalize is 'nan'; a finite number is needed",
    f"simulate euler {CONSTANT} --record 0.3": "record 0.3 s is not a whole multiple of the step",
    f"simulate euler {CONSTANT} --record 0.75": "duration 1 s is not a whole multiple of the record interval",
    f"simulate euler {CONSTANT} --record -1": "record is -1; a number above 0 is needed",
    f"simulate euler {CONSTANT} --record 2": "record 2 s is longer than the duration 1 s",
    # simulate: what goes with what
    "simulate euler": "one of --motion, --recording is needed; none given",
    f"simulate euler {CONSTANT} {EVEN} --rate-unit deg/s": "--motion and --recording are both given; one is needed",
    f"simulate euler {EVEN} --rate-unit rad/s": "--rate-unit rad/s contradicts the header",
    f"simulate euler {EVEN} --rate-unit deg/s --step 1": "--step needs --motion",
    f"simulate euler {EVEN} --rate-unit deg/s --duration 1": "--duration needs --motion",
    f"simulate euler {EVEN} --rate-unit deg/s --set x_deg_s=1": "--set needs --motion",
    f"simulate euler {CONSTANT} --matrices": "--matrices needs --format json",
    f"simulate euler {CONSTANT} --out run.png --plot run.png": "--out and --plot are both run.png",
    f"simulate euler {CONSTANT} --out file/run.txt --plot run.png": "cannot be written",
    f"simulate euler {CONSTANT} --out run.txt --plot file/run.png": "cannot be written",
    f"simulate euler {EVEN} --rate-unit deg/s --matrices": "--matrices needs --motion",
    f"simulate euler {CONSTANT} --rate-unit deg/s": "--rate-unit needs --recording",
    f"simulate euler {CONSTANT} --resample-hz 50": "--resample-hz needs --recording",
    f"simulate euler {EVEN} --resample-hz 50 --every 2": "--every and --resample-hz are both given",
    # simulate: recorded data
    "simulate euler --recording none.csv": "none.csv cannot be read (No such file or directory)",
    "simulate euler --recording nan.csv": "nan.csv, line 3: column dy is nan; a finite number is needed",
    "simulate euler --input rates --recording nan.csv --columns t,dx,dy,dz": "nan.csv, line 3: column dy is nan",
    "simulate euler --recording gap.csv": "gap.csv, line 5: a gap of 0.97 s",
    "simulate euler --input rates --recording gap.csv --columns t=t,x=dx,y=dy,z=dz": "line 5: a gap",
    f"simulate euler --recording {DATA}/rates_uneven.csv": "sample times are not even",
    f"simulate euler {EVEN} --rate-unit deg/s --resample-hz 0": "resample-hz is 0; a number above 0 is needed",
    f"simulate euler {EVEN} --rate-unit deg/s --resample-hz often": "resample-hz is 'often'; a finite number",
    f"simulate euler {EVEN} --rate-unit deg/s --resample-hz 1e-15": "makes no whole increment",
    f"simulate euler {EVEN} --rate-unit deg/s --record 0.033": "record 0.033 s is not a whole multiple",
    f"simulate euler {EVEN} --rate-unit deg/s --record 500": "record 500 s is longer than the recording",
    "simulate dcm --recording large.csv": "not finite",
    "simulate dcm --input rates --recording large.csv --columns t,dx,dy,dz --rate-unit rad/s": "finite",
    # simulate: output
    f"simulate euler {CONSTANT} --out file/run.txt": "file cannot be written",
    f"simulate euler {CONSTANT} --out .": "is a folder; a file is to be written there",
    f"simulate euler {CONSTANT} --plot file/run.png": "file cannot be written",
    # tables
    "tables --orthonormalize 0": "orthonormalize is 0",
    "tables --orthonormalize 0.3": "orthonormalize 0.3 s is not a whole multiple of the step",
    "tables --orthonormalize 7": "duration 180 s is not a whole multiple of the orthonormalize 7 s",
    "tables --predict --orthonormalize 10": "--predict and --orthonormalize do not go together",
    "tables --table 6": "table is 6; a whole number from 1 to 5 is needed",
}

FILES = {
    "file": "mine",
    "heun.toml": 'name="Heun"\nsource="-"\norder=3\nnodes=[0, 1]\nmatrix=[[], [1]]\nweights=["1/2", "1/2"]\n',
    "implicit.toml": 'name="Euler"\nsource="-"\norder=1\nnodes=[1]\nmatrix=[[1]]\nweights=[1]\n',
    "row.toml": 'name="Row"\nsource="-"\norder=1\nnodes=[0, 1]\nmatrix=[[], ["1/2"]]\nweights=["1/2", "1/2"]\n',
    "comment.toml": 'name="A"\nsource="*/ int x;"\norder=1\nnodes=[0]\nmatrix=[[]]\nweights=[1]\n',
    "kutta.toml": 'name="Euler"\nsource="-"\norder=1\nnodes=[0]\nmatrix=[[]]\nweights=[1]\n',
    "empty.py": "",
    "raises.py": "def algorithm():\n    raise ValueError('one' + chr(10) + 'two')\n",
    "broken.py": "def algorithm(:\n",
    "nonsense.py": "def algorithm():\n    return 3\n",
    "short.csv": "t,dx,dy,dz\n0.01,0,0,0\n0.02,0,0,0\n0.03,0,0,0\n",
    "nan.csv": "t,dx,dy,dz\n0.01,0,0,0\n0.02,0,nan,0\n0.03,0,0,0\n",
    "gap.csv": "t,dx,dy,dz\n0.01,0,0,0\n0.02,0,0,0\n0.03,0,0,0\n1,0,0,0\n1.01,0,0,0\n1.02,0,0,0\n",
    "wide.csv": "frequency_hz,density,angle_x_rad,angle_y_rad\n10,1,1,1\n1e9,1,1,1\n",
    **{
        f"{name}.csv": "frequency_hz,density,angle_x_rad,angle_y_rad,angle_y_phase_rad\n"
        + "".join(f"{hertz},{density},{angle},{angle},1\n" for hertz in (10, 20))
        for name, density, angle in (
            ("huge", "1", "1e200"),
            ("strong", "1.7e308", "0.1"),
            ("loud", "1e300", "100"),
        )
    },
    "large.csv": "t,dx,dy,dz\n" + "".join(f"0.{k},1e300,1e300,1e300\n" for k in range(1, 10)),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared_results: None) -> Path:
    """Return the folder in which the commands run, with the files that they are to stumble over; images are blank."""
    monkeypatch.setattr(figures, "image", lambda figure, path: figures.pyplot().close(figure) or b"blank")
    place = tmp_path / "folder"
    place.mkdir()
    for name, text in FILES.items():
        (place / name).write_text(text)
    monkeypatch.chdir(place)
    return place


@pytest.mark.parametrize(
    "command", [pytest.param(line, marks=[pytest.mark.posix] * ("/proc" in line)) for line in BAD]
)
def test_one_line_and_nothing_done(folder, capsys, command):
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command))
    said = capsys.readouterr()
    assert stop.value.code == 2
    assert said.out == ""
    assert said.err.startswith("strapgen: ")
    assert said.err.count("\n") == 1 and said.err.endswith("\n")
    assert BAD[command].lower() in said.err.lower()
    assert {path.name: path.read_text() for path in folder.iterdir()} == FILES


def test_old_output_survives_a_failure(folder, capsys):
    (folder / "run.csv").write_text("of yesterday")
    command = f"simulate euler --motion constant --set x_deg_s=1e300 {TIMES} --format csv --out run.csv"
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command))
    assert stop.value.code == 2
    assert (folder / "run.csv").read_text() == "of yesterday"


def test_missing_matplotlib(folder, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(f"simulate euler {CONSTANT} --plot run.png"))
    said = capsys.readouterr()
    assert (stop.value.code, said.out) == (2, "")
    assert said.err == "strapgen: plots need matplotlib: pip install 'strapgen[plot]'\n"


@pytest.mark.parametrize("place", ["file/cache", pytest.param("/proc/strapgen", marks=pytest.mark.posix)])
def test_cache_folder_that_cannot_be_written(place, folder, capsys, monkeypatch):
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", place)
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(f"simulate euler --method rk2 --increments 7 {CONSTANT}"))
    said = capsys.readouterr()
    assert (stop.value.code, said.out) == (2, "")
    assert said.err.startswith("strapgen: cache folder ") and said.err.count("\n") == 1


LONG = "x" * 5000


@pytest.mark.parametrize(
    "command",
    [
        f"simulate euler --{LONG}",
        f"simulate {LONG} {CONSTANT}",
        LONG,
        f"simulate euler --motion constant --set {LONG} --step 1 --duration 1",
        f"derive {LONG}.py",
        f"generate euler --target c --out {LONG}",
        f"simulate euler --recording {LONG}",
        f"generate euler --target c --name {LONG}",
        f"derive euler --method '{'x ' * 3000}'",
        f"{CONSTANT} {'x ' * 3000}",
    ],
)
def test_long_input_is_shortened_in_messages(command, folder, capsys):
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command))
    said = capsys.readouterr()
    assert (stop.value.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert len(said.err) < 2100 and "x" * 301 not in said.err
    assert "output cannot be written" not in said.err, "that is said of the terminal"


def test_a_path_is_repeated_in_full(folder, capsys):
    path = "/".join(["folder"] * 30)
    with pytest.raises(SystemExit):
        main(["simulate", "euler", "--recording", path])
    assert path in capsys.readouterr().err


@pytest.mark.parametrize("entry", ["1if 2else 3", "1is 1", "0x1for x in y", "1or 2"])
def test_python_s_warnings_of_a_coefficient_are_not_shown(entry, folder, capsys):
    text = 'name = "x"\nsource = "y"\norder = 1\nnodes = ["0"]\nmatrix = [[]]\nweights = ["{}"]\n'
    Path("method.toml").write_text(text.format(entry))
    with warnings.catch_warnings(record=True) as caught, pytest.raises(SystemExit) as stop:
        warnings.simplefilter("always")
        main(["tableau", "method.toml"])
    assert not caught
    assert stop.value.code == 2 and f"weights[1] is '{entry}'" in capsys.readouterr().err


@pytest.mark.parametrize(
    "source",
    [
        "--motion constant --set x_deg_s=1 --step 1e-3 --duration 3e3",
        "--input increments --recording log.csv",
    ],
)
def test_more_records_than_can_be_written(source, folder, capsys, monkeypatch):
    from strapgen.lab import simulate_command
    from strapgen.run.backends import Backend

    Path("log.csv").write_text("".join(f"{k / 10},0,0,0\n" for k in range(102)))
    monkeypatch.setattr(simulate_command, "_MOST_RECORDS", 2_000_000 if "motion" in source else 50)
    with monkeypatch.context() as patch:
        patch.setattr(Backend, "propagate", None)  # the run does not begin
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(f"simulate euler {source}"))
    said = capsys.readouterr()
    records, most = ("3000000", "2000000") if "motion" in source else ("51", "50")
    told = f"strapgen: {records} records are too many, up to {most} are written; --record S thins them\n"
    assert (stop.value.code, said.out, said.err) == (2, "", told)
    if "motion" not in source:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(f"simulate euler {source} --record 0.4"))
        assert stop.value.code == 0 and capsys.readouterr().out.count("\n") == 1 + 26


def test_run_that_the_memory_does_not_hold(folder, capsys, monkeypatch):
    from strapgen.lab import runs

    def exhausted(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(runs, "simulate", exhausted)
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(f"simulate euler {CONSTANT}"))
    said = capsys.readouterr()
    assert (stop.value.code, said.out) == (2, "")
    assert said.err == "strapgen: the memory does not hold a run of so many steps\n"


@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    [
        *(
            pytest.param(c, marks=pytest.mark.long)
            for c in ("derive eulr", "simulate euler --recording nan.csv")
        ),
        f"simulate dcm --motion constant --set x_deg_s=1e300 {TIMES}",
        pytest.param(
            "simulate dcm --input rates --recording large.csv --columns t,dx,dy,dz --rate-unit rad/s",
            marks=pytest.mark.long,
        ),
    ],
)
def test_so_it_is_for_a_process(command, folder):
    program = [sys.executable, "-m", "strapgen", *shlex.split(command)]
    done = subprocess.run(program, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("strapgen: ") and done.stderr.count("\n") == 1


def test_errors_of_our_own_are_not_hidden(capsys, monkeypatch):
    """What is no bad input keeps its traceback."""
    from strapgen import catalogue

    def broken(*_: object, **__: object) -> None:
        raise AssertionError("a fault in strapgen")

    monkeypatch.setattr(catalogue, "derive", broken)
    with pytest.raises(AssertionError, match="a fault in strapgen"):
        main(["derive", "euler"])
