// Runs strapgen in Python for WebAssembly, away from the page, so that the page stays alive meanwhile.
"use strict";

let answer = null; // answers.answer, once Python has loaded
let latest = 0; // number of the newest choice; what is computed for older ones is dropped

const PARTS = ["formula", "code", "coning", "series"];
const WORKING = {
  formula: "Deriving the step",
  code: "Writing the code",
  coning: "Computing the drift on coning",
  series: "Deriving the truncation error",
};

const say = (text, share, id) => postMessage({ type: "progress", text, share, id });
/** Lets messages in that came meanwhile. */
const pause = () => new Promise((resolve) => setTimeout(resolve, 0));

/** Counts the bytes of all that is fetched, and tells the page, also of what is missing. */
function countBytes(total) {
  const plainFetch = self.fetch;
  let bytes = 0;
  self.fetch = async (...request) => {
    const response = await plainFetch(...request).catch((error) => ({ statusText: error.message }));
    if (!response.ok) {
      // Python would wait for ever for some of its files.
      const name = String(request[0].url ?? request[0]).replace(/^.*\/try\//, "");
      const message = `try/${name} could not be loaded: ${response.status ?? ""} ${response.statusText}`.replace(/ +/g, " ");
      postMessage({ type: "failed", id: latest, message });
      throw new Error(message);
    }
    const counter = new TransformStream({
      transform(chunk, controller) {
        bytes += chunk.byteLength;
        const share = Math.min(bytes / total, 1);
        say(`Loading Python and SymPy, ${(total / 1e6).toFixed(0)} MB`, share);
        controller.enqueue(chunk);
      },
    });
    return new Response(response.body.pipeThrough(counter), response);
  };
}

async function start(manifest) {
  countBytes(manifest.bytes);
  importScripts("pyodide/pyodide.js");
  const archive = fetch(manifest.archive).then((response) => response.arrayBuffer());
  archive.catch(() => {}); // it is awaited below
  const python = await loadPyodide({ indexURL: new URL("pyodide/", self.location).href });
  python.unpackArchive(await archive, "zip", { extractDir: "/strapgen" });
  python.runPython("import sys; sys.path.insert(0, '/strapgen')");
  say("Starting SymPy", 1);
  python.runPython("import sympy");
  say("Starting strapgen", 1);
  answer = python.pyimport("answers").answer;
  postMessage({ type: "started" });
}

async function derive({ id, choice, tableau, parts = PARTS, terms = 1 }) {
  for (const part of parts) {
    await pause();
    if (id !== latest) return;
    say(WORKING[part], undefined, id);
    const result = JSON.parse(answer(part, ...choice, tableau, ...(part === "series" ? [terms] : [])));
    postMessage({ type: "part", id, part, result });
    if (result.error && part === "formula") break;
  }
  postMessage({ type: "done", id });
}

let started = null;

self.onmessage = async ({ data }) => {
  latest = data.id;
  try {
    started ??= start(data.manifest);
    await started;
    if (data.id === latest) await derive(data);
  } catch (error) {
    const lines = String(error.message ?? error).trim().split("\n");
    postMessage({ type: "failed", id: data.id, message: lines[lines.length - 1] });
  }
};
