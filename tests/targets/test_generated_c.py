"""What holds for every generated C file: lines, names, the proof at each value, compilers, and MISRA C:2012."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from fractions import Fraction
from functools import cache
from itertools import product
from pathlib import Path

import pytest

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice, standard
from strapgen.catalogue.names import KERNELS
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.units import Sensor
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.storage import resources
from strapgen.targets.names import external

ROOT = Path(__file__).parents[2]
FOLDERS = ("c", "c_float", "c_fixed")
STRICT = [
    "-std=c99",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wsign-conversion",
    "-Wshadow",
    "-Wcast-qual",
    "-Wdouble-promotion",
    "-Wfloat-conversion",
    "-Werror",
    "-fsyntax-only",
]
#: Compilers of this machine and of microcontrollers; the library of AVR computes floats as doubles, which there have as
#: many bits.
CROSS = {
    "gcc": [],
    "clang": [],
    "arm-none-eabi-gcc": ["-mcpu=cortex-m3", "-mthumb"],
    "riscv64-unknown-elf-gcc": ["-march=rv32imc", "-mabi=ilp32"],
    "avr-gcc": ["-mmcu=atmega2560", "-Wno-double-promotion"],
}
#: Increments in counts of a gyro, in 16 bits, and a state that saturates.
SENSOR = Settings(32, Fraction(1, 32), sensor=Sensor.of("0.0175dps", Fraction(1, 200)), state="q31")
#: Kernels whose error feedback is printed in all ways that there are, and words of other lengths.
WITH_FEEDBACK = [
    *(
        (name, Settings(32, carry="full"))
        for name in ("euler-rk4-2", "dcm-rk4-2", "dcm-rk1-2", "dcm-velocity-2")
    ),
    *((name, Settings(32, carry="full")) for name in ("euler-normalize", "dcm-orthonormalize", "dcm-update")),
    ("dcm-rk4-2", Settings(16, carry="state", rounding="truncation")),
    ("euler-normalize", Settings(16)),
    ("euler-rk2-2", SENSOR),
]


@cache
def texts() -> dict[str, str]:
    """Return the C of the standard catalogue, and the loops of some steps."""
    folder = resources.folder("generated")
    found = {path.name: path.read_text() for name in FOLDERS for path in (folder / name).glob("*.[ch]")}
    assert len(found) > 200
    for target in ("c", "c-fixed"):
        loops = Settings(carry="full") if target == "c-fixed" else None
        found |= two_speed_sources.sources("dcm", 2, target, loops).step_files
    settings = Settings(32, carry="full")
    for choice in standard():
        if choice.kernel in ("euler-rk4-2", "dcm-rk1-2"):
            for target in ("c", "c-float", "c-fixed"):
                found |= pipeline.compile(choice, target, settings if target == "c-fixed" else None).files
    return found


def without_comments(text: str) -> str:
    return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)


def test_lines_have_fewer_than_100_columns():
    long = [
        f"{name}: {line}" for name, text in texts().items() for line in text.splitlines() if len(line) > 99
    ]
    assert long == []


def test_names_have_at_most_31_characters():
    """But for what the loops of a host add to a function's name, and macros: C99 tells these apart by 63 characters."""
    names = {
        word
        for name, text in texts().items()
        if "_runs." not in name
        for word in re.findall(r"[A-Za-z_]\w*", without_comments(text))
    }
    assert [name for name in names if len(name) > (63 if name.isupper() else 31)] == []


FORMAT = r"Q-?\d+\.-?\d+, \S+ \.\. \S+, (exact|error \S+)(; stores [^*]+)?"


def test_every_fixed_point_value_has_its_format_range_and_error():
    values = 0
    for name, text in texts().items():
        if not name.endswith("_w32.c") or "memset" in text:  # what calls loops computes nothing itself
            continue
        body = text[text.index(f"\nint {name[:-2]}(") :]
        for declaration in re.findall(
            r"^    (?:const )?int(?:32|64)_t (\w+)[ ;][^;]*;?(.*(?:\n +/\*.*)?)", body, re.M
        ):
            variable, rest = declaration
            loaded = re.search(rf"{variable} = \w+\[\d+\];", body)
            if loaded or variable.endswith(("_sum", "_raw")):
                continue
            values += 1
            assert re.search(rf"/\* {FORMAT} \*/", rest) or re.search(
                rf"{variable}(?: =[^;]*)?;\s*/\* {FORMAT} \*/", body
            ), (name, variable)
    assert values > 900


def needed(program: str) -> None:
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not on this machine")


@pytest.mark.parametrize("compiler", CROSS)
def test_strict_compilers_take_all_files_as_one_text(compiler):
    needed(compiler)
    place = subprocess.run(
        [compiler, "-print-file-name=picolibc.specs"], capture_output=True, text=True, check=False
    )
    library = ["--specs=picolibc.specs"] if Path(place.stdout.strip()).is_absolute() else []
    folder = resources.folder("generated")
    with_double = "c" if compiler != "avr-gcc" else ""  # AVR has no double of 53 bits, which the files refuse
    files = sorted(p for name in FOLDERS if name != "c" or with_double for p in (folder / name).glob("*.c"))
    together = "".join(f'#include "{path}"\n' for path in files)
    command = [compiler, *STRICT, *CROSS[compiler], *library, "-x", "c", "-"]
    done = subprocess.run(command, input=together, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


# MISRA C:2012

#: What <stdint.h> and <float.h> define, which cppcheck does not read: without it, it stops at the #error of a file.
DEFINED = [
    "-DINT16_MAX=32767",
    "-DINT32_MAX=2147483647",
    "-DINT64_MAX=9223372036854775807",
    "-DFLT_RADIX=2",
    "-DFLT_MANT_DIG=24",
    "-DDBL_MANT_DIG=53",
    "-DFLT_EVAL_METHOD=0",
]
#: Runs the addon on each dump, as one call would for a single one, and then on what the files have in common.
ADDON = """
import sys
sys.path.insert(0, sys.argv[1])
import misra
dumps = sys.argv[2:]
for words in (*([dump] for dump in dumps), [dump.removesuffix("dump") + "ctu-info" for dump in dumps]):
    sys.argv = ["misra.py", "--cli", *words]
    misra.main()
"""


def addons() -> Path:
    """Return the folder of cppcheck's addons."""
    program = shutil.which("cppcheck")
    for folder in Path(program).resolve().parents[1].glob("**/cppcheck/addons") if program else ():
        if (folder / "misra.py").is_file():
            return folder
    pytest.skip("cppcheck with its addon misra.py is not on this machine")


def helpers(name: str, text: str) -> set[str]:
    """Return what stands before the function of a source, in parts, without the name of the function."""
    stem = name.removesuffix(".c")
    head = text[text.index("#include") : re.search(rf"\n\w+ {stem}\w*\(", text).start()]
    return {part.strip().replace(stem, "function") for part in re.split(r"\n\n(?=/\*)", head)}


def broken_rules(folder: Path, files: dict[str, str], seen: set[str] | None = None) -> set[str]:
    """Return the rules that files break.

    The parts before a file's function are the same in many files: each of them is analysed for all processors once, in
    the shortest file that has it; those that are seen already are not.
    """
    place = addons()
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    sources = {
        name: files[name] for name in sorted(files, key=lambda name: len(files[name])) if name[-1] == "c"
    }
    seen = set() if seen is None else seen
    for name, text in sources.items():
        everywhere = ["--force"] * (not helpers(name, text) <= seen)
        seen |= helpers(name, text)
        command = ["cppcheck", "--quiet", "--dump", *DEFINED, *everywhere, name]
        subprocess.run(command, cwd=folder, capture_output=True, check=True)
        dump = (folder / f"{name}.dump").read_text()
        assert f'type="Function" className="{name[:-2]}' in dump, f"{name} was not analysed"
    command = [sys.executable, "-c", ADDON, str(place), *(f"{name}.dump" for name in sources)]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout
    return {json.loads(line)["errorId"].removeprefix("c2012-") for line in said.splitlines()}


def explained(*where: str) -> set[str]:
    """Return the rules that the page names for files of some kinds."""
    rows = re.findall(
        r"^\| (\d+\.\d+) \| \w+ \| ([\w ]+) \|", (ROOT / "docs" / "evidence.md").read_text(), re.M
    )
    assert 0 < len(rows) <= 8 and {kind for _, kind in rows} <= {"all", "fixed point"}
    return {rule for rule, kind in rows if kind in where}


def test_helpers_have_one_text_and_are_called():
    """A reviewer reads each of them once."""
    helper_texts: dict[str, set[str]] = {}
    for path in (resources.folder("generated") / "c_fixed").glob("*.c"):
        text = path.read_text()
        for part in helpers(path.name, text):
            for ending in set(re.findall(r"^static .*?\bfunction(_\w+)\(", part, flags=re.MULTILINE)):
                helper_texts.setdefault(ending, set()).add(part)
                assert f"{path.stem}{ending}(" in text[re.search(rf"\nint {path.stem}\(", text).start() :]
    assert {ending: len(texts) for ending, texts in helper_texts.items()} == dict.fromkeys(helper_texts, 1)
    assert {"_out", "_mul", "_fit", "_shr", "_div", "_rt"} <= helper_texts.keys()


def generated_files(folder: str) -> dict[str, str]:
    """Return the generated files of a folder but for those that have the code of others, under other names."""
    paths = sorted((resources.folder("generated") / folder).glob("*.[ch]"))
    files = {
        path.name: path.read_text()
        for path in paths
        if not re.match(r"cayley_klein_|\w+_rk[123]_", path.name)
    }
    assert len(paths) / 2 < len(files) < len(paths)
    return files


@pytest.mark.long
def test_rules_of_misra_that_are_broken_in_floating_point_are_those_of_the_page(tmp_path):
    seen: set[str] = set()
    for name, files in (("c", generated_files("c")), ("c_float", generated_files("c_float"))):
        assert broken_rules(tmp_path / name, files, seen) == explained("all"), name
    loops = broken_rules(tmp_path / "loops", two_speed_sources.sources("dcm", 2, "c").step_files, seen)
    assert loops and loops <= explained("all", "fixed point")


@pytest.mark.long
def test_rules_of_misra_that_are_broken_in_fixed_point_are_those_of_the_page(tmp_path):
    """Of the catalogue, of error feedback and other words, and of the loops of an algorithm in two speeds."""
    others, seen, known = {}, set(), explained("all", "fixed point")
    for kernel, settings in WITH_FEEDBACK:
        (choice,) = (choice for choice in standard() if choice.kernel == kernel)
        others |= pipeline.compile(choice, "c-fixed", settings).step_files
    assert broken_rules(tmp_path / "others", others, seen) == known
    assert broken_rules(tmp_path / "catalogue", generated_files("c_fixed"), seen) == known
    settings = Settings(carry="full")
    loops = two_speed_sources.sources("dcm", 2, "c-fixed", settings).step_files
    broken = broken_rules(tmp_path / "loops", loops, seen)
    assert broken and broken <= known


@pytest.mark.long
def test_a_file_that_breaks_another_rule_of_misra_is_found(tmp_path):
    jump = "int f(int a)\n{\n    if (a > 0) {\n        goto end;\n    }\nend:\n    return a;\n}\n"
    assert "15.1" in broken_rules(tmp_path, {"f.h": "", "f.c": f'#include "f.h"\n\n{jump}'})


#: The folders of generated/ with the ending of their names.
ENDINGS = {"c": "", "c_float": "_float", "c_fixed": "_w32"}


def files(folder: str) -> list[Path]:
    paths = sorted((resources.folder("generated") / folder).glob("*.c"))
    assert len(paths) > 30
    return paths


def names_of_the_file(text: str) -> set[str]:
    """Return the names that a C source defines for itself: static functions, constants and types."""
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    both = code.count(
        "__attribute__((noinline))"
    )  # a product has a form for some processors, and one for all others
    code = code.replace("__attribute__((noinline)) ", "")
    static = list(dict.fromkeys(re.findall(r"^static [^;{=]*?(\w+)\s*\(", code, re.MULTILINE)))
    assert len(static) == len(re.findall(r"\bstatic\b", code)) - both
    constants = [
        name for body in re.findall(r"\benum\s*\{(.*?)\}", code) for name in re.findall(r"[A-Za-z_]\w*", body)
    ]
    return {*static, *constants, *re.findall(r"\btypedef\b[^;]*?(\w+);", code)}


def recurring(texts: Iterable[str]) -> list[str]:
    counts = Counter(name for text in texts for name in names_of_the_file(text))
    assert counts
    return [name for name, count in counts.items() if count > 1]


def test_no_static_name_recurs_in_two_files():
    texts = [path.read_text() for folder in ENDINGS for path in files(folder)]
    for word in (16, 64):  # words of 64 bits bring types of their own
        for kernel in ("euler-product", "euler-normalize", "euler-from-dcm"):
            sources = pipeline.compile(Choice(kernel), "c-fixed", Settings(word=word))
            texts += [text for name, text in sources.files.items() if name.endswith(".c")]
    assert recurring(texts) == []
    fixed = files("c_fixed")[0].read_text()
    assert recurring([fixed, fixed])


@pytest.mark.parametrize("folder", ENDINGS)
def test_static_names_begin_with_the_name_of_their_kernel(folder):
    for path in files(folder):
        names = names_of_the_file(path.read_text())
        assert [name for name in names if not name.lower().startswith(f"{path.stem}_")] == []


def external_names(kernel: str, ending: str) -> list[str]:
    name = external(kernel.replace("-", "_"), ending)
    return [name, *(f"{name}_{what}" for what in ("array", "batch", "propagate"))]


def test_external_names_of_the_catalogue_differ_in_the_31_characters_that_c99_promises():
    kernels = dict.fromkeys([*KERNELS, *(choice.kernel for choice in catalogue.standard())])
    names = [
        name
        for pair in product(kernels, ("", "_float", "_w16", "_w32", "_w64"))
        for name in external_names(*pair)
    ]
    assert len(names) == len(set(names))
    assert [start for start, count in Counter(name[:31] for name in names).items() if count > 1] == []


def test_user_kernels_with_equal_short_names_differ():
    catalogued = [kernel.replace("-", "_") for kernel in KERNELS]
    shortened = [external(name) for name in catalogued if external(name) != name]
    assert "dcm_orth_optimal" in shortened
    assert {external(name) for name in shortened}.isdisjoint(shortened)
    long = ("orthonormalize", "orth")
    users = [f"of_a_user_{first}_then_{second}" for first, second in product(long, long)]
    assert len({external(name).lower() for name in users}) == 4


def test_names_that_fit_are_not_shortened():
    assert external("mrp_norm") == "mrp_norm"
    assert external("dcm_orthonormalize") == "dcm_orthonormalize"
    assert external("cayley_klein_normalize", "_w32") == "cayley_klein_normalize_w32"
    assert external("normalizer_of_twenty_four") == "normalizer_of_twenty_four"
