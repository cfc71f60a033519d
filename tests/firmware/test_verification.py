"""What `strapgen verify` finds in a generated file that was changed, or was made by something else."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.cli import main
from strapgen.firmware.verification import _Exact
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.version import VERSION
from strapgen.run.generation import Request

NAME = "euler_rk4_2_w32"
GENERATED = Path(__file__).resolve().parents[2] / "generated" / "c_fixed"


def says(arguments: list[str], capsys) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    said = capsys.readouterr()
    return int(stop.value.code or 0), said.out, said.err


@pytest.fixture
def folder(tmp_path: Path, capsys) -> Path:
    command = f"generate euler --target c-fixed --max-rate-deg-s 400 --step 0.01 --out {tmp_path}"
    assert says(command.split(), capsys)[0] == 0
    return tmp_path


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
        ("c", r"1431655765", r"1431655763", "edited", True),
        ("c", r"(\+ \(INT64_C\(1\) << \d+\)), 38\)", r"\1, 37)", "edited", False),
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


def test_what_is_no_generated_file_is_one_line(tmp_path, capsys):
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
