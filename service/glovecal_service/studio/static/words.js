// Words of the glossary that stand on a page: underlined where each stands first, explained under the pointer,
// at a tap, and all of them behind one button. The page's own elements are not touched: ranges are highlighted.
const WORDS = "words-of-the-glossary";
const LEFT_OUT = "script, style, input, textarea, select, canvas, svg, .q-uploader, .words";
const AT_LEAST_MS = 400;

const meanings = await (await fetch(new URL("words.json", import.meta.url))).json();
const byForm = new Map();
for (const [word, meaning] of Object.entries(meanings)) {
  const form = word.toLowerCase();
  for (const like of [form, `${form}s`, form.replace(/y$/, "ies"), form.replace(/sis$/, "ses")])
    if (!byForm.has(like)) byForm.set(like, { word, meaning });
}
const escaped = [...byForm.keys()].sort((a, b) => b.length - a.length).map(form => form.replace(/[-\s]+/g, "[-\\s]+"));
const any = new RegExp(`(?<![\\p{L}\\p{N}_-])(${escaped.join("|")})(?![\\p{L}\\p{N}_-])`, "giu");
const entry = text => byForm.get(text.toLowerCase().replace(/\s+/g, " ")) ?? byForm.get(text.toLowerCase().replace(/-/g, " "));

let found = new Map();

function look() {
  const main = document.querySelector("#main");
  if (!main) return;
  const now = new Map();
  const nodes = document.createTreeWalker(main, NodeFilter.SHOW_TEXT, node =>
    node.parentElement?.closest(LEFT_OUT) || !node.parentElement?.checkVisibility?.()
      ? NodeFilter.FILTER_REJECT : NodeFilter.FILTER_ACCEPT);
  while (nodes.nextNode()) {
    for (const match of nodes.currentNode.data.matchAll(any)) {
      const known = entry(match[0]);
      if (!known || now.has(known.word)) continue;
      const range = new Range();
      range.setStart(nodes.currentNode, match.index);
      range.setEnd(nodes.currentNode, match.index + match[0].length);
      now.set(known.word, { range, meaning: known.meaning });
    }
  }
  found = now;
  if (globalThis.CSS?.highlights && globalThis.Highlight)
    CSS.highlights.set(WORDS, new Highlight(...[...now.values()].map(each => each.range)));
  button.hidden = now.size === 0;
}

const box = document.createElement("div");
box.className = "words words-box";
box.setAttribute("role", "tooltip");
box.hidden = true;
document.body.append(box);

function explain(event) {
  for (const [word, { range, meaning }] of found) {
    for (const place of range.getClientRects()) {
      const inside = event.clientX >= place.left && event.clientX <= place.right &&
        event.clientY >= place.top && event.clientY <= place.bottom;
      if (!inside) continue;
      box.replaceChildren(Object.assign(document.createElement("strong"), { textContent: word }), ` ${meaning}`);
      box.hidden = false;
      const width = Math.min(360, innerWidth - 16);
      box.style.maxWidth = `${width}px`;
      box.style.left = `${Math.max(8, Math.min(place.left, innerWidth - width - 8))}px`;
      const below = place.bottom + 8;
      box.style.top = `${below + box.offsetHeight < innerHeight ? below : Math.max(8, place.top - box.offsetHeight - 8)}px`;
      return;
    }
  }
  box.hidden = true;
}

document.addEventListener("pointermove", explain);
document.addEventListener("pointerdown", explain);
document.addEventListener("scroll", () => { box.hidden = true; }, { passive: true, capture: true });

const button = Object.assign(document.createElement("button"), { className: "words words-button", textContent: "Words on this page" });
button.type = "button";
button.hidden = true;
const list = document.createElement("dialog");
list.className = "words words-list";
list.setAttribute("aria-label", "Words on this page");
document.body.append(button, list);
button.addEventListener("click", () => {
  const words = document.createElement("dl");
  for (const [word, { meaning }] of [...found].sort())
    words.append(
      Object.assign(document.createElement("dt"), { textContent: word }),
      Object.assign(document.createElement("dd"), { textContent: meaning }));
  const close = Object.assign(document.createElement("button"), { type: "button", textContent: "Close" });
  close.className = "glove-act";
  close.addEventListener("click", () => list.close());
  list.replaceChildren(Object.assign(document.createElement("h2"), { textContent: "Words on this page" }), words, close);
  list.showModal();
});

let waiting = 0;
function again() {
  waiting ||= setTimeout(() => { waiting = 0; look(); }, AT_LEAST_MS);
}
new MutationObserver(again).observe(document.body, { childList: true, subtree: true, characterData: true });
again();
