// Words in the language that was chosen in the settings of the coach's page. English stands where
// it is shown; another language is a file of what stands in its place.

let words = {};

/// `t("frame {n}", { n: 3 })`: what stands in braces is replaced.
export function t(english, values = {}) {
  let text = words[english] ?? english;
  for (const [name, value] of Object.entries(values)) text = text.replaceAll(`{${name}}`, value);
  return text;
}

function chosen() {
  try {
    const kept = localStorage.getItem("court.language");
    if (kept) return kept;
  } catch {
    // Private windows may refuse.
  }
  return navigator.language.toLowerCase().startsWith("de") ? "de" : "en";
}

/// Loads the words and puts them in place of the English of the page.
export async function translate() {
  if (chosen() !== "de") return;
  words = await (await fetch("de.json")).json();
  document.documentElement.lang = "de";
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const text = node.data.trim();
    if (words[text]) node.data = node.data.replace(text, words[text]);
  }
  for (const attribute of ["title", "aria-label"]) {
    for (const element of document.querySelectorAll(`[${attribute}]`)) {
      element.setAttribute(attribute, t(element.getAttribute(attribute)));
    }
  }
}
