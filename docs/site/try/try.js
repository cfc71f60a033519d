// The page that runs strapgen: takes the reader's choice, has the worker derive it, and shows what comes back.
"use strict";

const $ = (name) => document.getElementById(`try-${name}`);
const make = (tag, attributes = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), attributes);
  element.append(...children);
  return element;
};

const DEFAULT = ["euler", "rk4", 2];
const OWN = "own"; // the method that stands for the reader's tableau
const STYLES = ["kept-1", "kept-2", "kept-3"]; // of the curves that the reader keeps
const PATIENCE = 3000; // ms
const FROM_DISK =
  "Your browser does not start Python in a page from disk: serve the site with make docs-serve, and open " +
  "http://127.0.0.1:8000/try.html.";

let manifest = null;
let worker = null;
let isStarted = false; // whether strapgen answers already in the worker
let isBusy = false;
let patience = 0; // timer after which a worker that is busy with an older question is replaced
let id = 0; // number of the newest question
let shown = {}; // what has come back for it, by part
let files = new Map(); // texts of the generated files by name, and their targets
let file = ""; // name of the file that is shown
let kept = []; // {name, result} of curves
let chart = null;

// Choices and addresses

/** Returns the choice in an address such as #euler-rk4-2; null for the headings of the page. */
function choiceOf(hash) {
  const name = decodeURIComponent(hash.slice(1));
  const algorithm = Object.keys(manifest.algorithms).find((each) => name.startsWith(`${each}-`));
  const match = algorithm && /^(.+)-(\d+)$/.exec(name.slice(algorithm.length + 1));
  return match ? [algorithm, match[1], Number(match[2])] : null;
}
const nameOf = ([algorithm, method, increments]) => `${algorithm}-${method}-${increments}`;
const chosen = () => [$("algorithm").value, $("method").value, Number($("increments").value)];

/** Shows a choice in the form; what the lists do not have is added, so that strapgen can say what it thinks of it. */
function select(choice) {
  for (const [name, value] of [["algorithm", choice[0]], ["method", choice[1]], ["increments", String(choice[2])]]) {
    const list = $(name);
    if (![...list.options].some((option) => option.value === value)) list.append(new Option(value, value));
    list.value = value;
  }
  $("own").hidden = choice[1] !== OWN;
}

function fillForm() {
  for (const [name, title] of Object.entries(manifest.algorithms)) $("algorithm").append(new Option(title, name));
  for (const [title, methods] of Object.entries(manifest.methods)) {
    const group = make("optgroup", { label: title });
    for (const [name, text] of Object.entries(methods)) group.append(new Option(`${name}: ${text}`, name));
    $("method").append(group);
  }
  $("method").append(make("optgroup", { label: "Yours" }, new Option("your Butcher tableau", OWN)));
  for (let k = 1; k <= manifest.most_increments; k += 1) $("increments").append(new Option(String(k), String(k)));
  for (const list of $("form").querySelectorAll("select")) {
    list.disabled = false;
    list.addEventListener("change", () => {
      location.hash = nameOf(chosen());
    });
  }
}

// The worker

function ask(question) {
  id += 1;
  if (!worker) {
    worker = new Worker("try/worker.js");
    worker.onmessage = ({ data }) => receive(data);
    worker.onerror = (event) => {
      event.preventDefault();
      fail(`The page could not start Python: ${event.message ?? "a file is missing"}`);
    };
  }
  clearTimeout(patience);
  if (isBusy && isStarted) {
    patience = setTimeout(() => {
      dismiss();
      ask(question);
    }, PATIENCE);
  }
  worker.postMessage({ tableau: $("tableau").value, ...question, id, manifest });
  isBusy = true;
  $("stop").hidden = false;
}

/** Ends the worker, in the middle of whatever it does. */
function dismiss() {
  worker?.terminate();
  worker = null;
  isStarted = isBusy = false;
}

function derive(choice) {
  select(choice);
  showError("");
  shown = {};
  $("results").classList.add("stale");
  $("results").setAttribute("aria-busy", "true");
  progress("Waiting for Python");
  document.title = `${nameOf(choice)} - strapgen`;
  ask({ choice });
}

function receive(message) {
  if (message.type === "started") isStarted = true;
  if (message.type === "progress" && (!message.id || message.id === id)) progress(message.text, message.share);
  if (message.id !== id) return;
  clearTimeout(patience);
  if (message.type === "failed") fail(message.message);
  if (message.type === "done") finish();
  if (message.type === "part") {
    shown[message.part] = message.result;
    if (!message.result.error) SHOW[message.part](message.result);
    else if (message.part === "formula") showError(message.result.error);
    else $(BOXES[message.part]).textContent = message.result.error;
    if (message.part === "formula") $("results").hidden = Boolean(message.result.error);
  }
}

function progress(text, share) {
  const line = `${text} …`;
  // Written only when it changes: a screen reader says it each time.
  if ($("status").textContent !== line) $("status").textContent = line;
  $("bar").hidden = false;
  if (share === undefined) $("bar").removeAttribute("value");
  else $("bar").value = share;
}

function finish() {
  isBusy = false;
  clearTimeout(patience);
  $("status").textContent = shown.formula?.error ? "" : `${nameOf(chosen())} is shown below.`;
  $("bar").hidden = true;
  $("stop").hidden = true;
  $("results").classList.remove("stale");
  $("results").removeAttribute("aria-busy");
}

function fail(line) {
  dismiss();
  finish();
  $("status").textContent = "";
  showError(line);
}

function showError(line) {
  $("error").textContent = line;
  $("error").hidden = !line;
}

// The parts

const SHOW = { formula: showFormula, code: showCode, coning: showConing, series: showSeries };
const BOXES = { code: "code", coning: "chart", series: "series" };
const COUNTS = {
  multiply: "multiplications", add: "additions", divide: "divisions", sqrt: "square roots",
  negate: "sign changes", select: "choices", function: "function calls",
};

function showFormula(result) {
  $("title").textContent = result.title;
  $("source").textContent = result.source;
  const tiles = [["order", result.order], ...Object.entries(result.operations).sort((a, b) => b[1] - a[1]).map(([name, count]) => [COUNTS[name], count])];
  tiles.push(["temporaries", result.temporaries]);
  $("cost").replaceChildren(...tiles.map(([name, value]) => make("div", {}, make("dt", { textContent: name }), make("dd", { textContent: value }))));
  const order = result.order_text.replace(/^./, (letter) => letter.toUpperCase());
  $("notes").replaceChildren(...[`${order}.`, ...result.notes].map((note) => make("li", { textContent: note })));
  showRows($("formula"), result.rows);
  for (const name of Object.values(BOXES)) $(name).textContent = "Working …";
  for (const name of ["tabs", "legend", "reading"]) $(name).replaceChildren();
  $("results").classList.remove("stale");
}

/** Shows rows of MathML, between whose pieces a line may end. */
function showRows(box, rows) {
  box.replaceChildren(
    ...rows.map((row) => {
      const right = make("div", { className: "right" });
      right.innerHTML = row.parts.join(" ");
      const left = make("div", { className: "left", innerHTML: row.left });
      return make("div", { className: "try-row" }, left, right);
    }),
  );
  // Browsers set no space behind a sign that begins a piece, and space within the bars of a length.
  for (const sign of box.querySelectorAll("mo")) {
    const space = { "|": "0", "+": "0.22em", "−": "0.22em" }[sign.textContent];
    const begins = sign.getAttribute("form") === "infix";
    if (sign.textContent === "|" || (begins && space)) {
      sign.setAttribute("lspace", "0");
      sign.setAttribute("rspace", space);
    }
  }
}

function showCode(result) {
  files = new Map(Object.entries(result.files).flatMap(([target, texts]) => Object.entries(texts).map(([name, text]) => [name, { text, target }])));
  const tabs = [...files.keys()].map((name) => make("button", { type: "button", textContent: name, id: `try-tab-${name}` }));
  for (const [k, tab] of tabs.entries()) {
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-controls", "try-code-panel");
    tab.addEventListener("click", () => showFile(tab.textContent));
    tab.addEventListener("keydown", (event) => {
      const to = { ArrowRight: k + 1, ArrowLeft: k - 1, Home: 0, End: tabs.length - 1 }[event.key];
      if (to === undefined) return;
      event.preventDefault();
      const next = tabs[(to + tabs.length) % tabs.length];
      next.focus();
      showFile(next.textContent);
    });
  }
  $("tabs").replaceChildren(...tabs);
  // The kind of file that was shown before, or else the C.
  const ending = /\.\w+$/.exec(file || "a.c")[0];
  showFile([...files.keys()].find((name) => name.endsWith(ending)));
}

function showFile(name) {
  file = name;
  // Not in the page itself, where the site's script for buttons would rename the box.
  $("code-box").classList.add("highlight");
  const { text, target } = files.get(name);
  $("code").replaceChildren(highlighted(text, name));
  $("code").scrollTo(0, 0);
  for (const tab of $("tabs").children) {
    const isShown = tab.textContent === name;
    tab.setAttribute("aria-selected", String(isShown));
    tab.tabIndex = isShown ? 0 : -1;
  }
  $("code-panel").setAttribute("aria-labelledby", `try-tab-${name}`);
  $("command").textContent = shown.code.command.replace("{target}", target);
  const isUnproved = shown.code.unproved && target === "c" && name.endsWith(".h");
  $("unproved").hidden = !isUnproved;
  $("unproved").textContent = isUnproved
    ? "This header states no bound of rounding, because its proof takes numpy; the command below proves one."
    : "";
}

function showSeries(result) {
  $("series-order").textContent = `${result.text.split("\n")[1]}.`.replace(/^./, (letter) => letter.toUpperCase());
  showRows($("series"), result.rows);
  $("more").hidden = result.terms > 1;
}

// Coning

function showConing(result) {
  $("read").max = result.ratios.length - 1;
  if (!$("read").dataset.isSet) {
    $("read").value = Math.round(result.ratios.length * 0.6);
    $("read").dataset.isSet = "yes";
  }
  draw();
}

function draw() {
  if (!shown.coning || shown.coning.error) return;
  const [angle, sampling] = [$("angle"), $("sampling")].map((input) => Number(input.value));
  const isAllowed = [$("angle"), $("sampling")].every((input) => input.value && input.checkValidity());
  for (const input of [$("angle"), $("sampling")]) input.setAttribute("aria-invalid", String(!input.value || !input.checkValidity()));
  if (!isAllowed) {
    $("reading").textContent = "once both numbers are in range";
    return;
  }
  const { ratios, drift, motion } = shown.coning;
  const curve = (name, drifts, style) => ({ name, style, points: points(ratios, drifts, angle, sampling / 1000) });
  const curves = [
    curve(shown.formula.kernel, drift, "chosen"),
    ...kept.map((each, k) => curve(each.name, each.drift, STYLES[k])),
    curve("without any correction", motion, "none"),
  ];
  chart = drawChart($("chart"), curves);
  for (const name of ["pointermove", "pointerdown"]) {
    chart.picture.addEventListener(name, (event) => {
      $("read").value = chart.nearest(event);
      read(curves);
    });
  }
  $("read").oninput = () => read(curves);
  read(curves);
  showLegend(curves);
  $("keep").disabled = kept.length === STYLES.length || kept.some((each) => each.name === shown.formula.kernel);
}

function read(curves) {
  const k = Number($("read").value);
  const [frequency, drift] = curves[0].points[k];
  $("reading").textContent = `${number(frequency)} Hz: ${number(drift)} °/h`;
  $("read").setAttribute("aria-valuetext", `${number(frequency)} hertz: ${number(drift)} degrees an hour`);
  chart.mark(k);
}

function showLegend(curves) {
  const entries = curves.map((curve) => {
    const entry = make("li", {}, make("span", { className: `swatch ${curve.style}` }), curve.name);
    if (curve.style.startsWith("kept")) {
      const remove = make("button", { type: "button", textContent: "Remove" });
      remove.setAttribute("aria-label", `Remove the curve of ${curve.name}`);
      remove.addEventListener("click", () => {
        kept = kept.filter((each) => each.name !== curve.name);
        draw();
      });
      entry.append(remove);
    }
    return entry;
  });
  if (shown.coning.resonant) {
    entries.push(make("li", { textContent: "This step mistakes vibration for rotation where it holds whole periods." }));
  }
  $("legend").replaceChildren(...entries);
}

// Buttons

const COPIES = {
  latex: () => shown.formula?.latex,
  code: () => files.get(file)?.text,
  command: () => $("command").textContent,
  series: () => shown.series?.text,
};

async function copy(button) {
  const label = button.textContent;
  const text = COPIES[button.dataset.copy]();
  if (!text) return;
  try {
    await navigator.clipboard.writeText(text);
    button.textContent = "Copied";
  } catch {
    button.textContent = "Not allowed";
  }
  setTimeout(() => (button.textContent = label), 1500);
}

function save() {
  const address = URL.createObjectURL(new Blob([files.get(file).text], { type: "text/plain" }));
  make("a", { href: address, download: file }).click();
  URL.revokeObjectURL(address);
}

function stop() {
  fail("");
  $("status").textContent = "You stopped it. Choose an algorithm to go on; Python then starts again.";
}

function wire() {
  for (const button of document.querySelectorAll("#try [data-copy]")) button.addEventListener("click", () => copy(button));
  $("save").addEventListener("click", () => files.has(file) && save());
  $("stop").addEventListener("click", stop);
  $("more").addEventListener("click", () => ask({ choice: chosen(), parts: ["series"], terms: 3 }));
  $("keep").addEventListener("click", () => {
    kept.push({ name: shown.formula.kernel, drift: shown.coning.drift });
    draw();
  });
  for (const name of ["angle", "sampling"]) $(name).addEventListener("input", draw);
  new ResizeObserver(() => requestAnimationFrame(draw)).observe($("chart"));
  $("form").addEventListener("submit", (event) => {
    event.preventDefault();
    derive(chosen());
  });
  window.addEventListener("hashchange", () => {
    const choice = choiceOf(location.hash);
    if (choice) derive(choice);
  });
}

async function begin() {
  if (location.protocol === "file:") {
    $("form").hidden = $("progress").hidden = true;
    showError(FROM_DISK);
    return;
  }
  progress("Loading the page");
  try {
    const response = await fetch("try/manifest.json");
    if (!response.ok) throw new Error(`try/manifest.json: ${response.status} ${response.statusText}`);
    manifest = await response.json();
  } catch (error) {
    fail(`The page could not load its files: ${error.message}`);
    return;
  }
  fillForm();
  wire();
  derive(choiceOf(location.hash) ?? DEFAULT);
}

begin();
