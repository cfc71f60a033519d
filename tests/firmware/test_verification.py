"""What `strapgen verify` finds in a generated file that was changed, or was made by something else."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from commands import says

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.cli.option_groups import stated
from strapgen.firmware import header_command, verification
from strapgen.firmware.verification import _Exact
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.version import VERSION
from strapgen.run.kernel_sources import Request
from strapgen.run.standard_tree import command_of, text_of

NAME = "euler_rk4_2_w32"
GENERATED = Path(__file__).resolve().parents[2] / "generated" / "c_fixed"


@pytest.fixture
def folder(tmp_path: Path, capsys, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    command = "generate euler --target c-fixed --max-rate-deg-s 400 --step 0.01 --out code"
    assert says(command, capsys)[0] == 0
    return tmp_path / "code"


def verified(path: Path, capsys, *more: str) -> tuple[int, dict]:
    status, out, _ = says(["verify", str(path), "--format", "json", *more], capsys)
    return status, json.loads(out)


def changed(path: Path, old: str, new: str) -> int:
    """Change a file in one place; return the number of the line."""
    text = path.read_text()
    place = re.search(old, text)
    assert place is not None
    path.write_text(text[: place.start()] + place.expand(new) + text[place.end() :])
    return text[: place.start()].count("\n") + 1


@pytest.mark.long
@pytest.mark.parametrize("ending", ["c", "h"])
def test_a_file_as_generated_holds(ending, folder, capsys):
    status, data = verified(folder / f"{NAME}.{ending}", capsys)
    assert status == 0 and data["holds"] and data["in_step"] and data["differences"] == []
    assert 0.5 <= data["max_ulp"] <= data["bound_ulp"] < 0.6


@pytest.mark.parametrize("method", ["rk1", "rk2"])
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_a_step_of_low_order_that_leaves_its_range_holds(algorithm, method, capsys):
    """On the cone its state grows until the code refuses it; the model refuses the same calls."""
    path = GENERATED / f"{algorithm}_{method}_2_w32.c"
    status, said, _ = says(["verify", str(path)], capsys)
    assert status == 0
    calls, of = re.search(r"(\d+) of (\d+) calls return what they must", said).groups()
    assert calls == of


def test_the_error_of_a_state_that_saturates_is_that_from_the_end_of_its_range():
    """The scalar of a product is 0.64, 1.28 and -1.28 from elements near 0.8: inside, and beyond either end."""
    request = Request(choose("euler-product"), "c-fixed", Settings(state="q15", word=16))
    exact = _Exact(request, pipeline.compile(*request).fixed)
    end, w = 1 << 15, 26215
    inside = exact.error([(0, 0, 0, w), (0, 0, 0, w)], [(0, 0, 0, 20972)])
    assert inside == pytest.approx(w * w / end - 20972, rel=1e-12)
    assert exact.error([(w, 0, 0, w), (-w, 0, 0, w)], [(0, 0, 0, end - 1)]) == 1, (
        "the largest word is a unit below"
    )
    assert exact.error([(w, 0, 0, w), (w, 0, 0, -w)], [(0, 0, 0, -end)]) == 0


@pytest.mark.parametrize("target", ["c-fixed", pytest.param("c", marks=pytest.mark.long)])
def test_a_file_with_constants_holds_and_one_with_others_does_not(target, tmp_path, capsys):
    """The constants in the header choose what the file is held to."""
    stated = "--constant slope_above=0.001 --constant slope_below=-1/3000"
    command = f"generate temperature-coefficient {stated} --target {target} --out {tmp_path}"
    assert says(command.split(), capsys)[0] == 0
    (path,) = tmp_path.glob("*.h")
    status, data = verified(path, capsys)
    assert status == 0 and data["holds"]
    changed(path, "-1/3000", "-1/2000")
    status, data = verified(path, capsys)
    assert status == 1 and not data["in_step"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("ending", "old", "new", "reason", "computes"),
    [
        ("c", r"178956971", r"178956970", "edited", True),
        ("c", r"(\+ \(INT16_C\(1\) << 4\)), 5\)", r"\1, 4)", "edited", False),
        ("h", r"--carry none", r"--carry full", "other options", None),
        (
            "h",
            rf"strapgen: {re.escape(VERSION)}",
            r"strapgen: 0.0.9",
            f"strapgen 0.0.9, this is {VERSION}",
            True,
        ),
        ("c", r"return 1;", r"return 0;", "edited", False),
    ],
    ids=["digit", "shift", "option", "version", "code"],
)
def test_a_change_is_found_with_its_line(ending, old, new, reason, computes, folder, capsys):
    path = folder / f"{NAME}.{ending}"
    line = changed(path, old, new)
    if computes is None:  # the command in the header asks for a function with more parameters
        computes, line = True, 4
    status, data = verified(path, capsys, "--run-differing")
    assert status == 1 and not data["holds"] and not data["in_step"]
    assert data["differences"][0].startswith(f"{path}:{line}: {reason}: ")
    assert bool(data["wrong_calls"]) is not computes


def test_series_of_a_declared_range_are_verified(tmp_path, capsys):
    words = f"generate euler --method magnus4 --target c --max-rate-deg-s 400 --step 0.01 --out {tmp_path}"
    assert says(words, capsys)[0] == 0
    status, said, _ = says(f"verify {tmp_path}/euler_magnus4_2.c", capsys)
    assert status == 0 and "return what they must" in said


@pytest.mark.long
@pytest.mark.parametrize("target", ["c", "c-float"])
def test_floating_point_is_held_to_its_bound(target, tmp_path, capsys):
    assert says(f"generate dcm --method rk2 --target {target} --out {tmp_path}".split(), capsys)[0] == 0
    (path,) = tmp_path.glob("*.c")
    status, data = verified(path, capsys)
    assert status == 0 and 0.5 < data["max_ulp"] < data["bound_ulp"]
    changed(path, r"A_12 \* C_11", "A_21 * C_11")
    status, data = verified(path, capsys, "--run-differing")
    assert status == 1 and data["wrong_calls"] and data["max_ulp"] > data["bound_ulp"]


def test_a_run_of_the_user_s_goes_through_the_file(folder, capsys):
    coning = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --duration 1"
    line = f"verify {folder / NAME}.c {coning} --format json --step"
    status, out, _ = says([*line.split(), "0.01"], capsys)
    assert status == 0 and json.loads(out)["calls"] == 400
    status, _, error = says([*line.split(), "0.5"], capsys)
    assert status == 2 and "the file takes at most 0.0349066 rad" in error


def test_a_file_is_compared_as_a_back_end_in_its_own_formats(folder, capsys):
    coning = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.01 --duration 1"
    line = f"compare euler --source {folder / NAME}.c --reference exact {coning} --format json"
    status, out, _ = says([*line.split(), "--fail-above", "1e-7"], capsys)
    (row,) = json.loads(out)
    assert status == 0 and row["backend"] == f"{folder / NAME}.c"
    assert 0 < row["max_abs_rad"] < row["bound_rad"] < 1e-6
    changed(folder / f"{NAME}.c", r"sigma_x = d1_x \+ d2_x", "sigma_x = d1_x + d2_y")
    assert says([*line.split(), "--fail-above", "1e-7", "--run-differing"], capsys)[0] == 1
    status, _, error = says(line.replace("euler", "dcm", 1).split(), capsys)
    assert status == 2 and "is euler-rk4-2, and dcm-rk4-2 is compared" in error


@pytest.mark.long
@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not on this machine")
def test_two_variants_with_names_of_their_own_link_together(tmp_path, capsys):
    for prefix, rate in (("slow_", 40), ("fast_", 400)):
        line = f"generate euler --target c-fixed --prefix {prefix} --max-rate-deg-s {rate} --step 0.01"
        assert says([*line.split(), "--out", str(tmp_path)], capsys)[0] == 0
    line = f"generate euler --target c-fixed --name attitude_step --out {tmp_path}"
    assert says(line.split(), capsys)[0] == 0
    names = [f"slow_{NAME}", f"fast_{NAME}", "attitude_step"]
    main_text = "".join(f'#include "{name}.h"\n' for name in names) + "int main(void)\n{\n"
    for name in names:
        main_text += f"    int32_t {name}_state[4] = {name.upper()}_IDENTITY, {name}_d[6] = {{0}};\n"
        main_text += f"    if ({name}({name}_state, {name}_d, {name}_state)) return 1;\n"
    (tmp_path / "main.c").write_text(main_text + "    return 0;\n}\n")
    sources = [f"{name}.c" for name in (*names, "main")]
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", *sources, "-o", "linked"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "linked"], check=False).returncode == 0
    assert verified(tmp_path / "attitude_step.c", capsys)[0] == 0


def test_other_files_are_refused_in_one_line(tmp_path, capsys):
    (tmp_path / "a.c").write_text("int a;\n")
    (tmp_path / "a.h").write_text("int a;\n")
    for path, said in (
        ("a.c", "does not say by which command"),
        ("b.c", "is not there"),
        ("a.txt", "is no C file"),
    ):
        status, _, error = says(["verify", str(tmp_path / path)], capsys)
        assert (status, error.count("\n")) == (2, 1) and said in error


def test_one_kernel_is_checked_as_all_are(folder, capsys):
    command = (
        f"generate euler --target c-fixed --max-rate-deg-s 400 --step 0.01 --check --out {folder}".split()
    )
    assert says(command, capsys)[:2] == (0, f"{folder}: 2 files, in step\n")
    changed(folder / f"{NAME}.c", "return 1;", "return 2;")
    status, out, error = says(command, capsys)
    assert status == 1 and "-        return 2;\n+        return 1;\n" in out and "out of step" in error
    assert "return 2;" in (folder / f"{NAME}.c").read_text()


def test_a_file_of_another_contract_is_written_over_by_force_alone(folder, capsys):
    command = f"generate euler --target c-fixed --carry full --out {folder}".split()
    before = (folder / f"{NAME}.c").read_text()
    status, _, error = says(command, capsys)
    assert status == 2 and "--max-rate-deg-s 400" in error and "--force" in error
    assert (folder / f"{NAME}.c").read_text() == before
    assert says([*command, "--force"], capsys)[0] == 0
    assert says(command, capsys)[0] == 0  # the same contract again
    (folder / f"{NAME}.h").write_text("/* mine */\n")
    assert "was not generated by strapgen" in says(command, capsys)[2]


EXAMPLES = Path(__file__).parents[2] / "examples"
COUNTS = "--target c-fixed --max-rate-deg-s 400 --sample-hz 100 --lsb 0.0175dps"


def state(command: str, folder: Path) -> None:
    """Let header and source state a command."""
    for path in (folder / f"{NAME}.h", folder / f"{NAME}.c"):
        text = path.read_text()
        a, b = text.index("Generated by:"), text.index("Do not edit")
        path.write_text(f"{text[:a]}Generated by: {command}\n * {text[b:]}")


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


#: Commands in headers that would print, write or run something, and what the refusal names.
MALICIOUS = {
    "strapgen generate --help": "--help",
    "strapgen generate euler -h": "-h",
    "strapgen --install-completion": "none that generates C",
    "strapgen generate euler --install-completion bash": "--install-completion",
    "strapgen generate euler --show-completion": "--show-completion",
    "strapgen --version generate euler": "none that generates C",
    "strapgen generate own.py": "--algorithm own.py",
    "strapgen generate ./own.py --target c-fixed": "--algorithm ./own.py",
    "strapgen generate --all --out .": "--all",
    "strapgen generate euler --target c-fixed --out victim": "--out",
    "strapgen generate euler --target c-fixed --out=victim": "--out",
    "strapgen generate euler --project --force": "--project",
    "strapgen generate euler --check": "--check",
    "strapgen generate euler --with-runs --target c": "--with-runs",
    "strapgen generate euler --tableau /dev/zero": "no regular file",
    "strapgen generate euler --layout pipe": "no regular file",
    "strapgen generate euler --tableau /proc/self/environ": "no regular file",
    "strapgen generate euler --tableau a\0b": "path is 'a\\x00b'",
    "strapgen system a\0.toml": "system is 'a\\x00.toml'",
    "strapgen generate 'euler --target c-fixed": "cannot be read",
    "strapgen generate euler dcm": "states algorithm 2 times",
    "strapgen generate euler --target": "--target has no value",
    "strapgen generate euler --target --word 32": "--target has no value",
    "strapgen generate --target c-fixed": "names nothing",
    "strapgen simulate euler --plot victim.svg": "none that generates C",
    "strapgen system described.toml --draw victim.svg": "--draw",
    "strapgen system described.toml --check": "--check",
    "strapgen system described.toml": "--algorithm own.py",
    "strapgen system pipe": "no regular file",
    "strapgen two-speed dcm --out victim": "--out",
    "strapgen window generate pipe": "no regular file",
    "strapgen preintegrate --window pipe": "no regular file",
    "strapgen window design --out victim.toml": "none that generates C",
    "sh -c 'touch victim'": "does not say by which command",
    "strapgen generate euler; touch victim": "states algorithm 3 times",
    "strapgen generate \x1b]0;title\x07": "",
}


@pytest.mark.posix
@pytest.mark.parametrize("command", MALICIOUS)
def test_malicious_header_is_refused_without_effect(command, folder, capsys):
    place = folder.parent
    (place / "own.py").write_text("open('victim', 'w').write('run')\n")
    described = (EXAMPLES / "strapdown.toml").read_text().replace('"velocity-counts"', '"own.py"', 1)
    (place / "described.toml").write_text(described)
    (place / "victim.svg").write_text("mine")
    os.mkfifo(place / "pipe")
    state(command, folder)
    before = contents(place)
    status, out, error = says(["verify", str(folder / f"{NAME}.h")], capsys)
    assert (status, out, error.count("\n")) == (2, "", 1) and MALICIOUS[command] in error
    assert error[:-1].isprintable() and contents(place) == before


def test_differing_file_is_neither_compiled_nor_loaded(folder, capsys):
    """A constructor in it would run as soon as the compiled file is loaded."""
    path, victim = folder / f"{NAME}.c", folder / "victim"
    path.write_text(
        path.read_text()
        + "\n#include <stdio.h>\n__attribute__((constructor)) static void run(void)\n"
        + f'{{\n    FILE *file = fopen("{victim}", "w");\n    if (file) fclose(file);\n}}\n'
    )
    status, out, _ = says(["verify", str(path)], capsys)
    assert status == 1 and "not compiled, since it differs; --run-differing" in out and not victim.exists()
    coning = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.01 --duration 0.1"
    line = ["compare", "euler", "--source", str(path), *coning.split()]
    status, _, error = says(line, capsys)
    assert (status, error.count("\n")) == (2, 1) and "--run-differing" in error and not victim.exists()
    assert says([*line, "--run-differing"], capsys)[0] == 0
    assert victim.exists(), "the test would notice that it runs"


@pytest.mark.parametrize(
    ("make", "ending"),
    [
        pytest.param(lambda path: os.mkfifo(path), "h", marks=pytest.mark.posix),
        (os.mkdir, "c"),
        (lambda path: path.symlink_to("nowhere"), "h"),
    ],
    ids=["pipe", "folder", "link"],
)
def test_loops_that_are_no_files_are_named(make, ending, folder, capsys):
    make(path := folder / f"{NAME}_runs.{ending}")
    status, out, _ = says(["verify", str(folder / f"{NAME}.c"), "--format", "json"], capsys)
    assert status == 1 and f"{path}: is empty or not there" in json.loads(out)["differences"]


@pytest.mark.posix
def test_file_of_the_kernel_is_not_waited_for(tmp_path):
    """A read of /proc/kmsg waits for what the kernel says next; like every file there it has no size."""
    (tmp_path / "whole.h").symlink_to("/proc/self/environ")
    assert text_of(tmp_path / "whole.h") == ""


def test_changed_line_ends_are_a_difference(folder, capsys):
    path = folder / f"{NAME}.c"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    status, out, _ = says(["verify", str(path), "--format", "json"], capsys)
    assert status == 1 and "ends of lines" in json.loads(out)["differences"][0]


def test_error_above_the_certified_bound_fails(folder, capsys, monkeypatch):
    """Just above it: a judgement that allows twice the bound is seen."""
    verified = verification.verify(folder / f"{NAME}.h", read_of(folder).request())
    assert verified.holds
    measure = verification._Exact.error
    for factor, status in ((1.001, 1), (0.999, 0)):

        def off(self, inputs, outputs, size=factor * verified.bound_ulp):
            measure(self, inputs, outputs)
            return size

        monkeypatch.setattr(verification._Exact, "error", off)
        assert says(["verify", str(folder / f"{NAME}.h")], capsys)[0] == status


def read_of(folder: Path) -> header_command.HeaderCommand:
    return header_command.read(command_of(text_of(folder / f"{NAME}.h")) or "")


def test_users_algorithm_runs_only_if_named_on_the_command_line(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(EXAMPLES / "modified_rodrigues.py", "own.py")
    assert says(["generate", "own.py", "--target", "c", "--out", "code"], capsys)[0] == 0
    (header,) = (path for path in Path("code").glob("*.h"))
    status, _, error = says(["verify", str(header)], capsys)
    assert status == 2 and "--algorithm own.py" in error
    line = ["verify", str(header), "--algorithm", "./own.py", "--format", "json"]
    assert says(line, capsys)[0] == 0


@pytest.mark.parametrize("command", ["generate euler", "two-speed dcm"])
def test_loops_over_runs_are_verified(command, tmp_path, capsys):
    assert says([*command.split(), "--target", "c", "--with-runs", "--out", str(tmp_path)], capsys)[0] == 0
    (source,) = tmp_path.glob("*_runs.c")
    header = tmp_path / f"{source.name.removesuffix('_runs.c')}.h"
    line = ["verify", str(header), "--format", "json"]
    status, out, _ = says(line, capsys)
    assert status == 0 and json.loads(out)["holds"]
    text = source.read_text()
    for broken in (text.replace("++", "--", 1), None):
        source.unlink() if broken is None else source.write_text(broken)
        status, out, _ = says(line, capsys)
        assert status == 1 and str(source) in json.loads(out)["differences"][0]


@pytest.mark.parametrize("command", ["two-speed dcm", "window generate window-3-3"])
def test_whole_of_several_functions_is_verified(command, tmp_path, capsys):
    assert says([*command.split(), "--target", "c-fixed", "--out", str(tmp_path)], capsys)[0] == 0
    line = ["verify", str(tmp_path), "--format", "json"]
    status, out, _ = says(line, capsys)
    data = json.loads(out)
    assert status == 0 and data["holds"] and len(data["stages"]) == 3
    whole = Path(data["header"]).with_suffix(".c")
    whole.write_text(whole.read_text().replace("return 0;", "return 1;", 1))
    status, out, _ = says(line, capsys)
    assert status == 1 and str(whole) in json.loads(out)["differences"][0]
    whole.unlink()
    status, out, _ = says(line, capsys)
    assert status == 1 and json.loads(out)["differences"] == [f"{whole}: is not there"]


WHOLES = {
    "two-speed dcm --target c-fixed --sample-hz 400 --lsb 0.0175dps": "--sample-hz 400 --lsb 0.0175dps",
    "two-speed dcm --target c-fixed --max-rate-deg-s 300 --sample-hz 400": "--max-rate-deg-s 300 --sample-hz 400",
    "two-speed euler --target c-fixed --lsb-rad 3e-6 --input-bits 12 --project": "--lsb-rad 3e-6 --input-bits 12",
    "system two-speed-dcm --target c-fixed --lsb 0.0175dps": "--sample-hz 3200 --lsb 0.0175dps",
    "system two-speed-dcm --target c-fixed --sample-hz 1600 --input-bits 16": "--sample-hz 1600",
    "system two-speed-dcm --target c --sample-hz 1600": "--sample-hz 1600",
}


@pytest.mark.parametrize("command", WHOLES)
def test_whole_states_the_gyro_and_is_generated_again(command, tmp_path, capsys):
    assert says([*command.split(), "--out", str(tmp_path)], capsys)[0] == 0
    status, out, _ = says(["verify", str(tmp_path), "--format", "json"], capsys)
    data = json.loads(out)
    assert status == 0 and data["holds"] and len(data["stages"]) == 3
    text = re.sub(r"\n \* +", " ", Path(data["header"]).read_text())
    assert WHOLES[command] in text and text.count("--sample-hz") == WHOLES[command].count("--sample-hz")
    assert ("counts of the gyro in 16 bits; 1 count = " in text) == ("lsb" in command)
    assert says([*command.split(), "--check", "--out", str(tmp_path)], capsys)[0] == 0
    header = Path(data["header"])
    header.write_text(header.read_text().replace("typedef", "typedef ", 1))
    status, out, error = says([*command.split(), "--check", "--out", str(tmp_path)], capsys)
    assert status == 1 and "-typedef " in out and "out of step" in error


def test_two_speed_reports_each_loop_as_generate_does(tmp_path, capsys):
    """Cost, gyro, range and certified bound: the same lines, from the same code, and the bounds in the header."""
    gyro = "--target c-fixed --sample-hz 400 --lsb 0.0175dps"
    status, out, _ = says(f"two-speed dcm {gyro} --out {tmp_path}".split(), capsys)
    lines = out.splitlines()
    assert status == 0 and lines[0].startswith("dcm-two-speed-2 for c-fixed: ") and " multiply" in lines[0]
    (fast,) = (k for k, line in enumerate(lines) if line.startswith("two-speed-fast-2 for c-fixed: "))
    assert "increment: counts of the gyro in 16 bits; 1 count = " in lines[fast + 1]
    assert sum(line.startswith("  next_coning: Q") and "error <=" in line for line in lines) == 1
    # The same options for the loop by itself, in the formats that the loops share.
    status, out, _ = says(f"two-speed dcm {gyro} --out {tmp_path} --format json".split(), capsys)
    functions = json.loads(out)["functions"]
    assert len(functions) == 3 and functions[0]["kernel"] == "two-speed-fast-2"
    command = command_of((tmp_path / "two_speed_fast_2_w32.h").read_text()) or ""
    _, out, _ = says([*shlex.split(command)[1:], "--out", str(tmp_path / "alone")], capsys)
    contract = [line for line in out.splitlines() if "error <=" in line or "counts of" in line]
    assert contract and {*contract} <= {*lines}
    text = (tmp_path / "dcm_two_speed_2_w32.h").read_text()
    worst = re.search(r"next_coning: Q\S+, error <= (\S+) ", "\n".join(lines))
    assert worst is not None and f"next_coning {worst[1]}" in text.replace("\n *     ", " ")


def test_header_command_reads_every_value_option():
    command = header_command.read(
        "strapgen generate imu-compensate --constant cycle=0.02 --constant 'rate_scale=1/3, -2e-9' --target c-fixed "
        "--word=16 --fix a=Q2.13"
    )
    values = command.values
    assert (values["algorithm"], values["targets"]) == ("imu-compensate", ("c-fixed",))
    assert stated(values["method"]) == {"--constant": {"cycle": "0.02", "rate_scale": "1/3, -2e-9"}}
    assert stated(values["fixed"]) == {"--word": 16, "--fix": {"a": "Q2.13"}}
    assert not values["all_"] and not stated(values["output"]) and values["format"] == "text"
    for several in ("strapgen two-speed dcm", "strapgen generate euler --target c,cpp"):
        with pytest.raises(InputError, match="does not generate one function"):
            header_command.read(several).request()


def test_compared_file_runs_on_the_counts_of_its_header(tmp_path, capsys):
    assert says(f"generate euler {COUNTS} --out {tmp_path}".split(), capsys)[0] == 0
    coning = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --step 0.02 --duration 2"
    line = f"compare euler --source {tmp_path / NAME}.c --reference exact --format json {coning}"
    status, out, _ = says(line.split(), capsys)
    (row,) = json.loads(out)
    assert status == 0 and row["max_abs_rad"] <= row["bound_rad"] < 1e-6
    status, _, error = says(f"{line} --backend c-fixed32 --lsb 0.02dps".split(), capsys)
    assert status == 2 and "different gyros" in error
