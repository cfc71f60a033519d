"""The Octave back end runs generated MATLAB functions, and the loop of a run, in a process of GNU Octave.

The process is started when it is needed, and then stays.

Arrays go to it and come back as the bytes of their doubles, in files of a folder that belongs to this process alone.
"""

from __future__ import annotations

import atexit
import math
import os
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from strapgen.ir.exceptions import CompilerError
from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.evaluators import Array, Evaluator, Loop
from strapgen.storage import cache

#: What Octave does for a request: it calls a function of some folders with arrays from one file, and writes the results
#: to another.
_CALL = """
function strapgen_call(left, added, name, shapes, outputs, varargin)
    if ~isempty(left)
        rmpath(left{:});
    end
    if ~isempty(added)
        addpath(added{:});
    end
    inputs = cell(size(shapes));
    file = fopen('arguments', 'r');
    for k = 1:numel(shapes)
        inputs{k} = reshape(fread(file, prod(shapes{k}), 'double=>double'), shapes{k});
    end
    fclose(file);
    results = cell(1, outputs);
    [results{:}] = feval(name, inputs{:}, varargin{:});
    file = fopen('results', 'w');
    for k = 1:outputs
        if ~isa(results{k}, 'double') || ~isreal(results{k})
            error('output %d of %s is no array of real doubles', k, name);
        end
        fwrite(file, results{k}, 'double');
    end
    fclose(file);
end
"""
_DONE = "done"
#: A request, and the line that answers it.
_REQUEST = (
    f"try, strapgen_call(%s); disp('{_DONE}'); "
    "catch caught, disp(strrep(caught.message, char(10), ' ')); end; fflush(stdout);\n"
)


def command() -> list[str]:
    """Return the command of Octave: that of $OCTAVE, or `octave-cli`; a `CompilerError` says that there is none."""
    return compiler.program_command("Octave", "OCTAVE", "octave-cli", "octave")


def missing() -> str:
    """Return why Octave cannot run; "" if it can."""
    try:
        command()
    except CompilerError as error:
        return str(error)
    return ""


class _Process:
    """A process of Octave that serves one request after another until this process ends."""

    def __init__(self) -> None:
        self.command = command()
        self._pid = os.getpid()
        self._folder = Path(tempfile.mkdtemp(prefix="strapgen-octave-"))
        (self._folder / "strapgen_call.m").write_text(_CALL, encoding="utf-8", newline="\n")
        self._places: dict[str, str] = {}  # the folder on the path by the files in it
        self._process = subprocess.Popen(
            [*self.command, "--norc", "--no-history", "--quiet", "--no-line-editing"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=self._folder,
            text=True,
        )
        atexit.register(self.stop)

    @property
    def serves(self) -> bool:
        """Whether it runs, and this process started it with the command of now; a fork must not share its pipes."""
        return self._pid == os.getpid() and self._process.poll() is None and self.command == command()

    def call(
        self,
        sources: Sequence[Sources],
        name: str,
        arguments: Sequence[Array],
        shapes: Sequence[tuple[int, ...]],
        *rest: str,
    ) -> list[Array]:
        """Call a function with the arrays and further arguments as text; return its results, which have the shapes.

        Sources are those of what is called, and of what that calls. After an interruption or a failure of Octave
        itself the process is stopped.
        """
        (self._folder / "arguments").write_bytes(b"".join(array.tobytes(order="F") for array in arguments))
        sizes = ", ".join(f"[{' '.join(map(str, (*array.shape, 1, 1)))}]" for array in arguments)
        left, added = (f"{{{', '.join(map(repr, folders))}}}" for folders in self._path(sources))
        words = [left, added, f"'{name}'", f"{{{sizes}}}", str(len(shapes)), *rest]
        answer = self._answer(_REQUEST % ", ".join(words))
        if answer != _DONE:
            raise CompilerError(f"Octave failed on {sources[0].kernel}: {answer}")
        numbers = np.frombuffer((self._folder / "results").read_bytes())
        ends = np.cumsum([math.prod(shape) for shape in shapes])
        if ends[-1] != numbers.size:
            raise CompilerError(
                f"Octave failed on {sources[0].kernel}: it returned {numbers.size} numbers; {ends[-1]} are needed"
            )
        parts = np.split(numbers, ends[:-1])
        return [part.reshape(shape, order="F") for part, shape in zip(parts, shapes, strict=True)]

    def _path(self, sources: Sequence[Sources]) -> tuple[list[str], list[str]]:
        """Return the folders to remove from the path of Octave and those to add, so that it finds these sources.

        A change costs Octave many times what a call does: a folder stays until another has a function of the same name.
        """
        folders = list(map(self._write, sources))
        places = {file: folder for one, folder in zip(sources, folders, strict=True) for file in one.files}
        left = {self._places[file] for file in places.keys() & self._places.keys()} - {*folders}
        self._places = {file: place for file, place in self._places.items() if place not in left}
        added = [folder for folder in dict.fromkeys(folders) if folder not in self._places.values()]
        self._places |= places
        return sorted(left), added

    def _write(self, sources: Sources) -> str:
        """Return the folder of some sources, written if it is not there."""
        name = cache.digest([part for item in sources.files.items() for part in item])
        folder = self._folder / name
        if not folder.is_dir():
            folder.mkdir()
            for file, text in sources.files.items():
                (folder / file).write_text(text, encoding="utf-8", newline="\n")
        return name

    def _answer(self, request: str) -> str:
        """Send a request and return the line that answers it."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            print(request, file=self._process.stdin, end="", flush=True)
            line = self._process.stdout.readline()
        except BaseException as error:
            self.stop()
            if isinstance(error, OSError):
                raise CompilerError("Octave has ended before it was done") from None
            raise
        if not line:
            self.stop()
            raise CompilerError("Octave has ended before it was done")
        return line.strip()

    def stop(self) -> None:
        """End the process and remove its folder."""
        atexit.unregister(self.stop)
        if self._pid == os.getpid():
            self._process.kill()
            self._process.communicate()
            shutil.rmtree(self._folder, ignore_errors=True)


_running: list[_Process] = []
_one_at_a_time = threading.Lock()


def call(
    sources: Sequence[Sources],
    name: str,
    arguments: Sequence[Array],
    shapes: Sequence[tuple[int, ...]],
    *rest: str,
) -> list[Array]:
    """Call a generated function in Octave, in the process that serves all calls; see `_Process.call`."""
    with _one_at_a_time:
        if not _running or not _running[0].serves:
            for process in _running:
                process.stop()
            _running[:] = [_Process()]
        return _running[0].call(sources, name, arguments, shapes, *rest)


class OctaveEvaluator(Evaluator):
    """A generated MATLAB function, which takes all samples in one call; they stand last in MATLAB."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)

    @property
    def name(self) -> str:
        """Name of the back end."""
        return "octave"

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Call the function on rows, see `Evaluator.call`."""
        count = len(feedback)
        arrays = [
            np.moveaxis(rows.reshape(count, *signal.shape), 0, -1)
            for rows, signal in zip(inputs, self.function.inputs, strict=True)
        ]
        shapes = [(*signal.shape, count) for signal in self.function.outputs]
        results = call([self.sources], self.function.name, arrays, shapes)
        return [
            np.moveaxis(result, -1, 0).reshape(count, signal.size)
            for result, signal in zip(results, self.function.outputs, strict=True)
        ], feedback

    def loop(self, samples: Array, loop: Loop) -> tuple[Array, Array]:
        """Run the loop in MATLAB, many runs side by side, see `Evaluator.loop`."""
        runs, steps = samples.shape[:2]
        state, rows = self.function.inputs
        sources, rest = [self.sources], [str(loop.record_every)]
        if loop.restore is not None:
            sources.append(loop.restore.sources)
            rest += [str(loop.restore_every), f"@{sources[-1].function.name}"]
        records = 1 + steps // loop.record_every
        (history,) = call(
            sources,
            f"{self.function.name}_propagate",
            [
                np.moveaxis(loop.state.reshape(runs, *state.shape), 0, -1),
                samples.reshape(runs, steps, *rows.shape).transpose(2, 3, 1, 0),
            ],
            [(*state.shape, records, runs)],
            *rest,
        )
        by_run = np.ascontiguousarray(np.moveaxis(history, (-1, -2), (0, 1)))
        return by_run.reshape(runs, records, state.size), loop.feedback
