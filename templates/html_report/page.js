// Tables sort and filter, code has colours and tabs, and what is printed is what is open.
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, place) => {
    const button = element("button", {type: "button"}, head.textContent);
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach(other => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const key = row => row.cells[place].dataset.value;
      const order = (a, b) => {
        const [x, y] = [key(a), key(b)];
        if (x === undefined || y === undefined) return (x === undefined) - (y === undefined);
        const numeric = x !== "" && y !== "" && !isNaN(x) && !isNaN(y);
        return (down ? -1 : 1) * (numeric ? x - y : x.localeCompare(y));
      };
      body.append(...[...body.rows].sort(order));
    });
  });
}
for (const field of document.querySelectorAll("input[data-filter]")) {
  const rows = [...document.getElementById(field.dataset.filter).children];
  field.addEventListener("input", () => {
    const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const row of rows) {
      row.hidden = !words.every(word => (row.dataset.words || row.textContent).toLowerCase().includes(word));
      count += !row.hidden;
    }
    field.parentElement.querySelector("output").textContent = words.length ? `${count} of ${rows.length}` : "";
  });
}

const KEYWORDS = {
  c: "auto|break|case|char|const|constexpr|continue|default|do|double|else|enum|extern|float|for|goto|if|inline|int|long|return|short|signed|sizeof|static|static_assert|struct|switch|typedef|uint\\d+_t|int\\d+_t|size_t|unsigned|void|while",
  python: "and|as|assert|break|class|continue|def|elif|else|False|for|from|if|import|in|is|None|not|or|pass|raise|return|True|while|with|yield",
};
const PARTS = {
  c: String.raw`(\/\*[\s\S]*?\*\/|\/\/[^\n]*)|(^[ \t]*#[a-z_]+)|("(?:\\.|[^"\\\n])*")|\b(0[xX][\da-fA-F]+[uUlL]*|\d+(?:\.\d*)?(?:[eE][-+]?\d+)?[fFuUlL]*)\b`,
  python: String.raw`("""[\s\S]*?"""|#[^\n]*)|(^@\w+)|("(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*')|\b(\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\b`,
};
function colour(code) {
  if (code.dataset.coloured) return;
  code.dataset.coloured = "yes";
  const text = code.textContent, kind = code.dataset.language, pieces = [];
  const pattern = new RegExp(`${PARTS[kind]}|\\b(${KEYWORDS[kind]})\\b`, "gm");
  let end = 0;
  for (const match of text.matchAll(pattern)) {
    pieces.push(text.slice(end, match.index));
    const place = match.slice(1).findIndex(part => part !== undefined);
    pieces.push(element("span", {class: ["comment", "directive", "string", "number", "keyword"][place]}, match[0]));
    end = match.index + match[0].length;
  }
  code.replaceChildren(...pieces, text.slice(end));
}
for (const tabs of document.querySelectorAll(".tabs")) {
  const buttons = [...tabs.querySelectorAll("[role=tab]")];
  const choose = chosen => buttons.forEach(button => {
    button.setAttribute("aria-selected", button === chosen);
    button.tabIndex = button === chosen ? 0 : -1;
    const panel = document.getElementById(button.getAttribute("aria-controls"));
    panel.hidden = button !== chosen;
    if (button === chosen) panel.querySelectorAll("code").forEach(colour);
  });
  buttons.forEach((button, k) => {
    button.addEventListener("click", () => choose(button));
    button.addEventListener("keydown", event => {
      const next = {ArrowRight: k + 1, ArrowLeft: k - 1}[event.key];
      if (next !== undefined) { const other = buttons[(next + buttons.length) % buttons.length]; choose(other); other.focus(); }
    });
  });
  tabs.closest("details").addEventListener("toggle", () => choose(buttons.find(button => button.getAttribute("aria-selected") === "true")), {once: true});
}
for (const button of document.querySelectorAll("button[data-copy]")) {
  button.addEventListener("click", async () => {
    const code = button.closest(".command, figure").querySelector("code");
    try { await navigator.clipboard.writeText(code.textContent); button.textContent = "Copied"; }
    catch { getSelection().selectAllChildren(code); button.textContent = "Selected"; }
    setTimeout(() => { button.textContent = "Copy"; }, 1500);
  });
}
for (const button of document.querySelectorAll("button[data-open]"))
  button.addEventListener("click", () => document.querySelectorAll("details.algorithm").forEach(one => { one.open = button.dataset.open === "yes"; }));
const openTarget = () => {
  const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (target && target.matches("details")) { target.open = true; target.scrollIntoView(); }
};
addEventListener("hashchange", openTarget);
openTarget();
