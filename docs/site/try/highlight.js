// Colours C, C++ and Python with the classes that the site's own style sheets know.
"use strict";

const WORDS = {
  c: "break case const constexpr continue do double else extern float for if inline int int32_t int64_t long namespace noexcept return short signed sizeof size_t static struct switch template typedef typename unsigned using void volatile while",
  python: "and as assert break class continue def elif else except for from if import in is lambda None not or pass raise return True False try while with yield",
};
const TOKENS = {
  c: /(?<c1>\/\*[^]*?\*\/|\/\/.*)|(?<cp>^[ \t]*#.*)|(?<s>"(?:[^"\\\n]|\\.)*")|(?<m>\b\d[\w.]*(?:(?<=e)[+-]\d+)?)|(?<w>\b[A-Za-z_]\w*)/gm,
  python: /(?<s>"""[^]*?"""|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*')|(?<c1>#.*)|(?<m>\b\d[\w.]*(?:(?<=e)[+-]\d+)?)|(?<w>\b[A-Za-z_]\w*)/gm,
};
const KEYWORDS = Object.fromEntries(Object.entries(WORDS).map(([name, words]) => [name, new Set(words.split(" "))]));

/** Returns the nodes that show a source text; `name` is that of its file. */
function highlighted(text, name) {
  const language = name.endsWith(".py") ? "python" : "c";
  const fragment = document.createDocumentFragment();
  let place = 0;
  for (const match of text.matchAll(TOKENS[language])) {
    let [kind] = Object.entries(match.groups).find(([, value]) => value !== undefined);
    if (kind === "w") {
      if (!KEYWORDS[language].has(match[0])) continue;
      kind = "k";
    }
    fragment.append(text.slice(place, match.index));
    const token = document.createElement("span");
    token.className = kind;
    token.textContent = match[0];
    fragment.append(token);
    place = match.index + match[0].length;
  }
  fragment.append(text.slice(place));
  return fragment;
}
